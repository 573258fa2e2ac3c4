"""A trained estimator as one ONNX file that carries all that the board must know."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from datagen.recipe import parse_recipe
from soilml import __version__
from soilml.errors import SoilmlError
from soilml.io.atomic_files import atomic_output
from soilml.onboard.features import READABLE, computed, inputs_of, parts
from soilml.onboard.model_file import DRIVEN, FORMAT, KIND, behind, checksum
from soilml.onboard.set_contract import RESPONSE_CHANNELS
from soilml.quantities import QUANTITIES, column
from training.data.targets import PER_ROW
from training.onnx_graph.builder import IR_VERSION, OPSET, Graph, Output, session_of
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.metadata import figures_of, metadata_of, probe_of_sets
from training.train import Trained

Floats = NDArray[np.float64]

#: Largest difference to the float64 original, in prior standard deviations, that may be exported.
TOLERANCE = 1e-4
PARITY_ROWS = 8192


def draw(trained: Trained) -> Any:
    """The whole estimator as an ONNX model without metadata.

    With a set posterior it has two branches, of which one is run: with the input `joint` true all
    rows are answered for together, else each by itself. What a branch does not read or give need
    not be fed, and comes back empty.
    """
    names = list(inputs_of(trained.spec.features))
    q, posterior = len(trained.spec.targets), trained.posterior
    inputs: dict[str, list[Any]] = {name: ["rows"] for name in names}
    outputs: dict[str, Output] = {
        "mean": (1, ["rows", q]),
        "std": (1, ["rows", q]),
        "covariance": (1, ["rows", q, q]),
        "in_range": (9, ["rows"]),
    }
    graph = Graph()
    if posterior is None:
        _draw_rows(trained, graph, "")
        return graph.model(inputs, outputs)
    rows, sets = Graph("rows_"), Graph("sets_")
    _draw_rows(trained, rows, "rows_")
    posterior.add_to(sets, "sets_")
    outputs = {
        name: (kind, [None] * len(shape))
        for name, (kind, shape) in (outputs | posterior.outputs).items()
    }
    graph.either("joint", sets, rows, outputs)
    for name, value in (posterior.defaults() | {"joint": np.zeros(1, bool)}).items():
        graph.default(name, value)
    return graph.model(inputs | posterior.inputs | {"joint": [1]}, outputs)


def _draw_rows(trained: Trained, graph: Graph, prefix: str) -> None:
    """Every row by itself; outputs are named `<prefix><output>`."""
    spec, estimator = trained.spec, trained.estimator
    names = list(inputs_of(spec.features))
    double = {name: graph.double(name) for name in names}
    columns = []
    for feature in spec.features:
        top, bottom = parts(feature)
        value = graph.op("Div", double[top], double[bottom]) if bottom else double[top]
        columns.append(graph.reshaped(value, -1, 1))
    features = graph.op("Concat", *columns, axis=1)
    mean, std = estimator.regressor.draw(graph, features)
    std = graph.op("Mul", std, graph.constant(estimator.widen))
    q = len(spec.targets)
    outer = graph.op("Mul", graph.reshaped(std, -1, q, 1), graph.reshaped(std, -1, 1, q))
    covariance = graph.op("Mul", outer, graph.constant(estimator.correlation))
    inside = trained.support.draw(graph, features)
    graph.op("Identity", inside, out=prefix + "in_range")
    ends = [graph.constant(end) for end in (trained.prior.lower, trained.prior.upper)]
    kept = graph.op("Min", graph.op("Max", mean, ends[0]), ends[1])
    prior = np.diag(trained.prior.std**2)
    answers = {
        "mean": (kept, trained.prior.mean, (-1, 1)),
        "std": (std, trained.prior.std, (-1, 1)),
        "covariance": (covariance, prior, (-1, 1, 1)),
    }
    for name, (value, otherwise, shape) in answers.items():
        flag = graph.reshaped(inside, *shape)
        answer = graph.op("Where", flag, value, graph.constant(otherwise))
        graph.single(answer, prefix + name)


def export(
    trained: Trained, path: str | os.PathLike[str], data_path: str | os.PathLike[str]
) -> dict[str, str]:
    """Write the file and return its metadata; raises `SoilmlError` where parity is missed.

    Bytes depend on the spec and the data alone.
    """
    model = draw(trained)
    parity = _parity(trained, model)
    if not parity < TOLERANCE:
        raise SoilmlError(
            f"the exported model differs from the original by {parity:.1e} of the prior's spread, "
            f"more than {TOLERANCE:g}: lower gamma, or take fewer centres"
        )
    metadata = _metadata(trained, parity, data_path)
    write_model(model, metadata, path)
    return metadata


def write_model(model: Any, metadata: dict[str, str], path: str | os.PathLike[str]) -> None:
    """Write a graph with its metadata and their checksums."""
    graph = model.SerializeToString(deterministic=True)
    metadata["graph_sha256"] = hashlib.sha256(graph).hexdigest()
    metadata["metadata_sha256"] = checksum(metadata)
    with atomic_output(path) as part:
        part.write_bytes(graph + behind(metadata))


def _metadata(trained: Trained, parity: float, data_path: str | os.PathLike[str]) -> dict[str, str]:
    spec, data = trained.spec, trained.data
    recipe = data.recipe
    inputs = [
        {
            "name": name,
            "column": QUANTITIES[name].column,
            "unit": QUANTITIES[name].unit,
            "lower": float(values.min()),
            "upper": float(values.max()),
        }
        for name, values in trained.parts.train.measured.items()
    ]
    outputs = [
        {
            "name": name,
            "column": QUANTITIES[name].column,
            "unit": QUANTITIES[name].unit,
            "lower": float(data.lower[k]),
            "upper": float(data.upper[k]),
            "prior_mean": float(trained.prior.mean[k]),
            "prior_std": float(trained.prior.std[k]),
            **({"per_row": True} if name in PER_ROW else {}),
        }
        for k, name in enumerate(spec.targets)
    ]
    joint = trained.together
    return {
        "soilml_format": FORMAT,
        "soilml_version": __version__,
        "inputs": json.dumps(inputs),
        "outputs": json.dumps(outputs),
        "gear": json.dumps(json.loads(recipe).get("gear", {}), sort_keys=True),
        "together": json.dumps(
            {
                "over": joint.driven.names,
                **{key: getattr(joint.driven, key).tolist() for key in DRIVEN},
                "kinds": [
                    {"varies": kind.varies} | {key: getattr(kind, key).tolist() for key in KIND}
                    for kind in joint.kinds
                ],
                "alone": joint.alone.tolist(),
                "doubt": joint.doubt.tolist(),
            }
        ),
        "probe": json.dumps([_probe(trained), *probe_of_sets(trained.posterior)]),
        **(
            {}
            if trained.posterior is None
            else {"set": json.dumps(_set(trained.posterior, recipe))}
        ),
        "spec": spec.text,
        "recipe": recipe,
        "recipe_sha256": hashlib.sha256(recipe.encode()).hexdigest(),
        "data_sha256": hashlib.sha256(Path(data_path).read_bytes()).hexdigest(),
        "metrics": json.dumps(
            {
                name: {
                    "rmse": score.rmse.tolist(),
                    "rmse_share_of_prior": score.relative.tolist(),
                    "nll": score.nll.tolist(),
                    "cover50": score.cover50.tolist(),
                    "cover90": score.cover90.tolist(),
                    "rows": score.rows,
                }
                for name, score in trained.scores.items()
            }
        ),
        "metrics_of_posterior": json.dumps(figures_of(trained.figures)),
        "metrics_of_sets": json.dumps(
            {
                kind: {
                    size: {
                        "rmse_share_of_prior": score.relative.tolist(),
                        "cover90": score.cover90.tolist(),
                        "sets": score.rows,
                    }
                    for size, score in scores.items()
                }
                for kind, scores in trained.sets.items()
            }
        ),
        "parity": f"{parity:.3e}",
        "opset": str(OPSET),
        "ir_version": str(IR_VERSION),
    }


def _set(posterior: SetPosteriorGraph, recipe: str) -> dict[str, Any]:
    """What the board must know of the set posterior: noise that is taken for given."""
    content = parse_recipe(recipe, "recipe of the data")
    noise = {
        name: [content.case.noise[column(name)].constant, content.case.noise[column(name)].share]
        for name in RESPONSE_CHANNELS
        if column(name) in content.case.noise
    }
    bias = content.bias.get(column("torque"))
    if bias is not None:
        noise["torque_bias"] = [bias.constant, bias.share]
    return metadata_of(posterior, noise, alone=False)


def _box(trained: Trained) -> dict[str, Floats]:
    """Readings (n,) that fill the training box, and rows that were learned from."""
    measured = trained.parts.train.measured
    fill = qmc.Sobol(len(measured), rng=11).random(PARITY_ROWS)
    step = max(len(trained.parts.train) // PARITY_ROWS, 1)
    found = {}
    for k, (name, values) in enumerate(measured.items()):
        box = values.min() + (values.max() - values.min()) * fill[:, k]
        found[name] = np.concatenate([box, values[::step]])
    return found


def _parity(trained: Trained, model: Any) -> float:
    """Largest difference of mean or std to the float64 original, in prior standard deviations."""
    session = session_of(model)
    readings = _box(trained)
    feed = {name: values.astype(np.float32) for name, values in readings.items()}
    mean, std, flag = session.run(("mean", "std", "in_range"), feed)
    true_mean, true_std, inside = trained.predict(computed(trained.spec.features, readings))
    off = np.maximum(np.abs(mean - true_mean), np.abs(std - true_std)) / trained.prior.std
    same = flag == inside  # a reading rounded across the edge of the range differs by its nature
    if same.mean() < 0.999:
        raise SoilmlError("the exported in-range flag differs from the original")
    return float(off[same].max())


def _probe(trained: Trained) -> dict[str, Any]:
    """A few readings with their answers, which the board checks when it loads the file.

    The last is far out of range, and possible: halfway to the end of what can be measured.
    """
    chosen = np.linspace(0, len(trained.parts.train) - 1, 8).astype(int)
    readings = {}
    for name, values in trained.parts.train.measured.items():
        far = 0.5 * (values.max() + min(READABLE[name][1], 100.0 * np.abs(values).max()))
        readings[name] = np.append(values[chosen], far).astype(np.float32).astype(np.float64)
    mean, std, inside = trained.predict(computed(trained.spec.features, readings))
    return {
        "readings": {name: values.tolist() for name, values in readings.items()},
        "mean": mean.tolist(),
        "std": std.tolist(),
        "in_range": inside.tolist(),
    }
