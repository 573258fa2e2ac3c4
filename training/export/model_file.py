"""Export of a trained model as one ONNX file that holds all that the runtime needs."""

from __future__ import annotations

import hashlib
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from soilml.errors import SoilmlError
from soilml.io.atomic_files import atomic_output
from soilml.onboard.features import READABLE, compute_features
from soilml.onboard.model_file import metadata_checksum, serialise_metadata
from training.export.estimator_graph import build_graph
from training.export.file_metadata import file_metadata
from training.onnx_graph.builder import session_of
from training.set_posterior.metadata import probe_of_sets
from training.train import TrainedModel

Floats = NDArray[np.float64]

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
