"""Export of a trained model as one ONNX file that holds all that the runtime needs."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from soilml import __version__
from soilml.config.model_settings import take_gear
from soilml.errors import SoilmlError
from soilml.io.atomic_files import atomic_output
from soilml.io.toml_settings import Settings
from soilml.onboard.features import READABLE, compute_features
from soilml.onboard.gaussian_pooling import write_pooling
from soilml.onboard.model_file import FORMAT, metadata_checksum, serialise_metadata
from soilml.onboard.set_contract import INTERFACE
from soilml.quantities import QUANTITIES
from training.dataset import PER_ROW
from training.export.estimator_graph import build_graph
from training.onnx_graph.builder import IR_VERSION, OPSET, session_of
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.validation import figures_of, metadata_of, probe_of_sets
from training.train import TrainedModel

Floats = NDArray[np.float64]


def file_metadata(
    trained: TrainedModel,
    probe: list[dict[str, Any]],
    parity: float,
    data_path: str | os.PathLike[str],
) -> dict[str, str]:
    """Metadata of a model file: what the runtime needs, provenance and metrics; values are JSON."""
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
    return {
        "soilml_format": FORMAT,
        "soilml_interface": INTERFACE,
        "soilml_version": __version__,
        "inputs": json.dumps(inputs),
        "outputs": json.dumps(outputs),
        "gear": json.dumps(_gear_in_si(json.loads(recipe).get("gear", {})), sort_keys=True),
        "together": json.dumps(write_pooling(trained.pooling)),
        "probe": json.dumps(probe),
        **_set_metadata(trained.set_posterior),
        "spec": spec.text,
        "recipe": recipe,
        "recipe_sha256": hashlib.sha256(recipe.encode()).hexdigest(),
        "data_sha256": _data_digest(Path(data_path)),
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
        "metrics_of_posterior": json.dumps(figures_of(trained.set_figures)),
        "metrics_of_sets": json.dumps(
            {
                label: {
                    length: {
                        "rmse_share_of_prior": score.relative.tolist(),
                        "cover90": score.cover90.tolist(),
                        "sets": score.rows,
                    }
                    for length, score in scores.items()
                }
                for label, scores in trained.pooled_scores.items()
            }
        ),
        "parity": f"{parity:.3e}",
        "opset": str(OPSET),
        "ir_version": str(IR_VERSION),
    }


def _gear_in_si(entry: dict[str, Any]) -> dict[str, Any]:
    """The gear of a recipe, with numbers for values that have a unit, such as "150 mm"."""
    if not entry:
        return {}
    made = take_gear(Settings(dict(entry), "[gear]", Path()))
    return {
        name: getattr(made, name, value) if isinstance(value, str) else value
        for name, value in entry.items()
    }


def _set_metadata(posterior: SetPosteriorGraph | None) -> dict[str, str]:
    """The entry "set" of a set posterior."""
    if posterior is None:
        return {}
    return {"set": json.dumps(metadata_of(posterior, sets_only=False))}


def _data_digest(path: Path) -> str:
    """SHA-256 of a data file, or of the files of a folder one after the other."""
    digest = hashlib.sha256()
    for file in sorted(path.glob("*.parquet")) if path.is_dir() else [path]:
        with file.open("rb") as opened:
            while block := opened.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


#: Largest allowed difference to the float64 original, in prior standard deviations.
TOLERANCE = 1e-4
#: Readings that the difference is measured on: quasi-random ones, and about as many training rows.
PARITY_ROWS = 8192
#: Readings of one call, which bounds the memory for files of many prototypes.
PARITY_AT_A_TIME = 1024


def export_model(
    trained: TrainedModel, path: str | os.PathLike[str], data_path: str | os.PathLike[str]
) -> dict[str, str]:
    """Write a model file; its bytes depend on the spec and the data only.

    Parameters
    ----------
    trained : TrainedModel
        From `train`.
    path : str or PathLike
        The file to write.
    data_path : str or PathLike
        The data that it was trained on; their checksum is part of the metadata.

    Returns
    -------
    dict of str to str
        The metadata of the file.

    Raises
    ------
    SoilmlError
        Where the float32 file differs from the float64 original by more than `TOLERANCE`.
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
    graph = model.SerializeToString(deterministic=True)
    metadata["graph_sha256"] = hashlib.sha256(graph).hexdigest()
    metadata["metadata_sha256"] = metadata_checksum(metadata)
    with atomic_output(path) as part:
        part.write_bytes(graph + serialise_metadata(metadata))


def _parity_readings(trained: TrainedModel) -> dict[str, Floats]:
    """Readings (n,) that fill the box of the training rows, and some of these rows."""
    measured = trained.parts.train.measured
    fill = qmc.Sobol(len(measured), rng=11).random(PARITY_ROWS)
    step = max(len(trained.parts.train) // PARITY_ROWS, 1)
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
    chosen = np.linspace(0, len(trained.parts.train) - 1, 8).astype(int)
    readings = {}
    for name, values in trained.parts.train.measured.items():
        far = 0.5 * (values.max() + min(READABLE[name][1], 100.0 * np.abs(values).max()))
        readings[name] = np.append(values[chosen], far).astype(np.float32).astype(np.float64)
    mean, std, inside = trained.predict(compute_features(trained.spec.features, readings))
    return {
        "readings": {name: values.tolist() for name, values in readings.items()},
        "mean": mean.tolist(),
        "std": std.tolist(),
        "in_range": inside.tolist(),
    }
