"""Export of a trained model as one ONNX file: graph, metadata, and a probe of both."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from soilml import __version__
from soilml.arrays import Floats
from soilml.config.model_settings import take_gear
from soilml.errors import SoilmlError
from soilml.io.atomic_files import atomic_output
from soilml.io.toml_settings import Settings
from soilml.onboard.features import READABLE, compute_features, inputs_of, numerator_denominator
from soilml.onboard.held_out_errors import together
from soilml.onboard.model_file import FORMAT, with_checksums
from soilml.onboard.set_contract import INTERFACE
from soilml.quantities import QUANTITIES, SHEAR, Z_90
from training.dataset import PER_ROW
from training.onnx_graph.builder import IR_VERSION, OPSET, Graph, Output, session_of
from training.onnx_graph.value import Value, absolute, concat, maximum, minimum, where
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.posterior_summary import prior_summary
from training.set_posterior.validation import (
    SetFigures,
    figures_of,
    metadata_of,
    probe_of_sets,
)
from training.spec import AnyWheelSpec
from training.train import TrainedModel

#: Sums of inputs and features up to this are finite; one with NaN or an infinity is not below it.
LARGEST_SUM = 1e300
#: The input that the prior of an output scales with, in a file for any wheel.
SCALES = {"cohesion": "cohesion_max", "shear_modulus": "shear_modulus_max"}


def build_graph(trained: TrainedModel) -> Any:
    """The ONNX model, without metadata.

    With a set posterior it has two branches, of which one is run: with the input `joint` true the
    set posterior of all rows, otherwise estimates of single rows. Inputs that a branch does not
    read need not be fed; outputs that it does not compute are empty.
    """
    names = list(inputs_of(trained.spec.features))
    q, posterior = len(trained.spec.targets), trained.set_posterior
    inputs: dict[str, list[Any]] = {name: ["rows"] for name in names}
    outputs: dict[str, Output] = {
        "mean": (1, ["rows", q]),
        "std": (1, ["rows", q]),
        "covariance": (1, ["rows", q, q]),
        "in_range": (9, ["rows"]),
    }
    graph = Graph()
    if posterior is None:
        _add_single_rows(trained, graph, "")
        return graph.model(inputs, outputs)
    rows, sets = graph.branch("rows_"), graph.branch("sets_")
    _add_single_rows(trained, rows, "rows_")
    posterior.add_to(sets, "sets_")
    outputs = {
        name: (element_type, [None] * len(shape))
        for name, (element_type, shape) in (outputs | posterior.outputs).items()
    }
    graph.either("joint", sets, rows, outputs)
    for name, value in (posterior.defaults() | {"joint": np.zeros(1, bool)}).items():
        graph.default(name, value)
    return graph.model(inputs | posterior.inputs | {"joint": [1]}, outputs)


def _add_single_rows(trained: TrainedModel, graph: Graph, prefix: str) -> None:
    """Add the estimates of single rows to a graph; outputs are named `<prefix><output>`."""
    spec, estimator, prior = trained.spec, trained.estimator, trained.prior
    double = {name: Value(graph, name).astype(np.float64) for name in inputs_of(spec.features)}
    first, *others = double.values()
    total = first.node("Sum", *others)  # (rows,), also where an input has one element
    rows = total.node("Shape")
    double = {name: value.node("Expand", rows) for name, value in double.items()}
    columns = []
    for feature in spec.features:
        top, bottom = numerator_denominator(feature)
        value = double[top] / double[bottom] if bottom else double[top]
        columns.append(value.reshape(-1, 1))
    features = concat(columns, axis=1)
    # the features of rows with inputs or features that are not finite are replaced by zeros
    finite = absolute(total + features.sum(axis=1, keepdims=False)) <= LARGEST_SUM
    features = where(finite.reshape(-1, 1), features, 0.0)
    mean, std = estimator.regressor.add_to_graph(features)
    std, q = std * estimator.std_scale, len(spec.targets)
    covariance = std.reshape(-1, q, 1) * std.reshape(-1, 1, q) * estimator.correlation
    inside = trained.domain.contains(features) & finite
    inside.node("Identity").named(prefix + "in_range")
    clipped = minimum(maximum(mean, prior.lower), prior.upper)
    answers = {
        "mean": (clipped, prior.mean, (-1, 1)),
        "std": (std, prior.std, (-1, 1)),
        "covariance": (covariance, np.diag(prior.std**2), (-1, 1, 1)),
    }
    for name, (value, otherwise, shape) in answers.items():
        where(inside.reshape(*shape), value, otherwise).astype(np.float32).named(prefix + name)


def file_metadata(
    trained: TrainedModel,
    probe: list[dict[str, Any]],
    parity: float,
    data_path: str | os.PathLike[str],
) -> dict[str, str]:
    """Metadata of a model file: what the runtime needs, provenance and metrics; values are JSON."""
    spec, data, prior = trained.spec, trained.data, trained.prior
    posterior = trained.set_posterior
    outputs = [
        _quantity(name, data.lower[k], data.upper[k], prior.mean[k], prior.std[k])
        | ({"per_row": True} if name in PER_ROW else {})
        for k, name in enumerate(spec.targets)
    ]
    metrics = {
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
    entries = {
        "inputs": [_quantity(n, v.min(), v.max()) for n, v in data.measured.items()],
        "outputs": outputs,
        "gear": dict(sorted(_gear_in_si(json.loads(data.recipe).get("gear", {})).items())),
        "together": together(trained.left_out.factor, trained.errors),
        "probe": probe,
        **({} if posterior is None else {"set": metadata_of(posterior, sets_only=False)}),
        "metrics": metrics,
        "metrics_of_posterior": figures_of(trained.set_figures),
    }
    return _metadata(entries) | {
        "spec": spec.text,
        "recipe": data.recipe,
        "recipe_sha256": hashlib.sha256(data.recipe.encode()).hexdigest(),
        "data_sha256": _data_digest(Path(data_path)),
        "parity": f"{parity:.3e}",
    }


def export_any_wheel(
    spec: AnyWheelSpec,
    posterior: SetPosteriorGraph,
    figures: dict[int, SetFigures],
    path: str | os.PathLike[str],
) -> dict[str, str]:
    """Write a file for wheels of any size, which has a set posterior only; returns its metadata.

    Its bytes depend on the spec only.
    """
    graph = Graph()
    posterior.add_to(graph)
    for name, value in posterior.defaults().items():
        graph.default(name, value)
    prior, axes = prior_summary(posterior.family), posterior.family.axes
    outputs = [
        _quantity(name, *axis.ends, prior["mean"][k], prior["std"][k])
        | ({"scale": SCALES[name]} if name in SCALES else {})
        for k, (name, axis) in enumerate(zip(SHEAR, axes, strict=False))
    ]
    entries = {
        "inputs": [_quantity(name) for name in ("slip", "torque", "load")],
        "outputs": outputs,
        "gear": {"type": "wheel"},
        "together": together(np.full(len(SHEAR), round(Z_90, 3))),
        "set": metadata_of(posterior, sets_only=True),
        "probe": probe_of_sets(posterior),
        "recipe": {},
        "metrics_of_posterior": figures_of(figures),
    }
    digest = hashlib.sha256(spec.text.encode()).hexdigest()
    metadata = _metadata(entries) | {"spec": spec.text, "spec_sha256": digest}
    write_model(graph.model(posterior.inputs, posterior.outputs), metadata, path)
    return metadata


def _metadata(entries: dict[str, Any]) -> dict[str, str]:
    """Entries as JSON, and the versions of a file."""
    return {
        "soilml_format": FORMAT,
        "soilml_interface": INTERFACE,
        "soilml_version": __version__,
        "opset": str(OPSET),
        "ir_version": str(IR_VERSION),
        **{key: json.dumps(value) for key, value in entries.items()},
    }


def _quantity(name: str, *numbers: float) -> dict[str, Any]:
    """The entry of an input or output; of numbers so many as are given."""
    keys = ("lower", "upper", "prior_mean", "prior_std")
    entry: dict[str, Any] = {
        "name": name,
        "column": QUANTITIES[name].column,
        "unit": QUANTITIES[name].unit,
    }
    return entry | {key: float(value) for key, value in zip(keys, numbers, strict=False)}


def _gear_in_si(entry: dict[str, Any]) -> dict[str, Any]:
    """The gear of a recipe, with numbers for values that have a unit, such as "150 mm"."""
    if not entry:
        return {}
    made = take_gear(Settings(dict(entry), "[gear]"))
    return {
        name: getattr(made, name, value) if isinstance(value, str) else value
        for name, value in entry.items()
    }


def _data_digest(path: Path) -> str:
    """SHA-256 of a data file, or of the files of a folder one after the other."""
    digest = hashlib.sha256()
    for file in sorted(path.glob("*.parquet")) if path.is_dir() else [path]:
        with file.open("rb") as opened:
            while block := opened.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


TOLERANCE = 1e-4  # Largest allowed difference to the float64 original, in prior standard deviations
#: Readings that the difference is measured on: quasi-random ones, and about as many training rows.
PARITY_ROWS = 8192
#: Readings of one call, which bounds the memory for files of many prototypes.
PARITY_AT_A_TIME = 1024


def export_model(
    trained: TrainedModel, path: str | os.PathLike[str], data_path: str | os.PathLike[str]
) -> dict[str, str]:
    """Write a model file; its bytes depend on the spec and the data only.

    trained: From `train`.
    path: The file to write.
    data_path: The data that it was trained on; their checksum is part of the metadata.

    Returns: The metadata of the file.
    Raises `SoilmlError` where the float32 file differs from the float64 original by more than
    `TOLERANCE`.
    """
    model = build_graph(trained)
    parity = _parity(trained, model)
    if not parity < TOLERANCE:
        raise SoilmlError(
            f"the exported model differs from the original by {parity:.1e} of the prior's spread, "
            f"more than {TOLERANCE:g}: use a smaller gamma, or fewer centres"
        )
    probe = [_probe(trained), *probe_of_sets(trained.set_posterior)]
    metadata = file_metadata(trained, probe, parity, data_path)
    write_model(model, metadata, path)
    return metadata


def write_model(model: Any, metadata: dict[str, str], path: str | os.PathLike[str]) -> None:
    """Write a graph with its metadata; the checksums of both are added to `metadata`."""
    content = with_checksums(model.SerializeToString(deterministic=True), metadata)
    with atomic_output(path) as part:
        part.write_bytes(content)


def _parity_readings(trained: TrainedModel) -> dict[str, Floats]:
    """Readings (n,) that fill the box of the training rows, and some of these rows."""
    measured = trained.data.measured
    fill = qmc.Sobol(len(measured), rng=11).random(PARITY_ROWS)
    step = max(len(trained.data) // PARITY_ROWS, 1)
    readings = {}
    for k, (name, values) in enumerate(measured.items()):
        box = values.min() + (values.max() - values.min()) * fill[:, k]
        readings[name] = np.concatenate([box, values[::step]])
    return readings


def _parity(trained: TrainedModel, model: Any) -> float:
    """Largest difference of mean or std to the float64 original, in prior standard deviations."""
    session = session_of(model)
    readings = _parity_readings(trained)
    feed = {name: values.astype(np.float32) for name, values in readings.items()}
    rows = len(next(iter(feed.values())))
    parts = []
    for first in range(0, rows, PARITY_AT_A_TIME):
        some = {name: values[first : first + PARITY_AT_A_TIME] for name, values in feed.items()}
        parts.append(session.run(("mean", "std", "in_range"), some))
    mean, std, flag = (np.concatenate(part) for part in zip(*parts, strict=True))
    true_mean, true_std, inside = trained.predict(compute_features(trained.spec.features, readings))
    difference = np.maximum(np.abs(mean - true_mean), np.abs(std - true_std)) / trained.prior.std
    same = flag == inside  # float32 rounding moves a few readings across the edge of the domain
    if same.mean() < 0.999:
        raise SoilmlError("the exported in-range flag differs from the original")
    return float(difference[same].max())


def _probe(trained: TrainedModel) -> dict[str, Any]:
    """Eight training rows and one far out of range, with the answers that the file must reproduce.

    The last lies halfway between the largest training value and the end of what can be measured.
    """
    chosen = np.linspace(0, len(trained.data) - 1, 8).astype(int)
    readings = {}
    for name, values in trained.data.measured.items():
        far = 0.5 * (values.max() + min(READABLE[name][1], 100.0 * np.abs(values).max()))
        readings[name] = np.append(values[chosen], far).astype(np.float32).astype(np.float64)
    mean, std, inside = trained.predict(compute_features(trained.spec.features, readings))
    return {
        "readings": {name: values.tolist() for name, values in readings.items()},
        "mean": mean.tolist(),
        "std": std.tolist(),
        "in_range": inside.tolist(),
    }
