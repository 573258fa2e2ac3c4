"""A graph in single precision, which small processors compute in hardware."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.onboard.metadata import read_fields
from soilml.onboard.model_file import create_session
from soilml.onboard.set_contract import Floats

LARGEST = float(np.finfo(np.float32).max)  # Stands for numbers that float cannot hold
#: Readings by which both precisions are compared, spread over the ranges of training.
READINGS = 4096
#: Largest difference of an answer that single precision may make, in standard deviations of the
#: prior. Sums of a kernel method, whose large weights cancel, are changed by far more.
TOLERANCE = 1e-5


def in_single_precision(model: Any, metadata: Mapping[str, str]) -> tuple[Any, float]:
    """The model in single precision, if this does not change estimates from single rows.

    The set posterior is in single precision as it is. Estimates from single rows are double in the
    file; they are narrowed unless an answer, of readings spread over the ranges of training,
    differs by more than `TOLERANCE`.

    model: The model with its graph, which is not changed.
    metadata: The metadata of the file.

    Returns: The model, and the largest change of a mean or standard deviation, in standard
    deviations of the prior; infinity where it changes which readings are in range, and NaN where
    nothing is in double precision, or there are no such estimates.
    """
    narrow = type(model)()
    narrow.CopyFrom(model)
    if not _narrow(narrow.graph) or "mean" not in [output.name for output in model.graph.output]:
        return model, float("nan")
    before, after = (_answers(m, metadata) for m in (model, narrow))
    inside = before["in_range"]
    if not np.array_equal(inside, after["in_range"]):
        return model, float("inf")
    changes = [np.abs(after[key] - before[key])[inside] for key in ("mean", "std")]
    change = float(np.max(changes / read_fields(metadata)["prior"].std))
    return narrow if change < TOLERANCE else model, change


def _answers(model: Any, metadata: Mapping[str, str]) -> dict[str, Floats]:
    """Mean, standard deviation and flag of readings spread over the ranges of training."""
    rng, feed = np.random.default_rng(0), {}
    for entry in json.loads(metadata["inputs"]):
        readings = rng.uniform(entry["lower"], entry["upper"], READINGS)
        feed[entry["name"]] = readings.astype(np.float32)
    session = create_session(model.SerializeToString())
    names = ("mean", "std", "in_range")
    return dict(zip(names, session.run(names, feed), strict=True))


def _narrow(graph: Any) -> bool:
    """Narrow constants and casts, in branches too; whether there were any in double precision.

    Finite numbers beyond those of float32 become the largest of these, so that comparisons with
    them still find what is not finite.
    """
    from onnx import AttributeProto, TensorProto

    found = [_narrow_tensor(tensor) for tensor in graph.initializer]
    for node in graph.node:
        for attribute in node.attribute:
            if attribute.type == AttributeProto.GRAPH:
                found.append(_narrow(attribute.g))
            elif attribute.type == AttributeProto.TENSOR:
                found.append(_narrow_tensor(attribute.t))
            elif node.op_type == "Cast" and attribute.i == TensorProto.DOUBLE:
                attribute.i = TensorProto.FLOAT
                found.append(True)
    return any(found)


def _narrow_tensor(tensor: Any) -> bool:
    from onnx import TensorProto, numpy_helper

    if tensor.data_type != TensorProto.DOUBLE:
        return False
    values = numpy_helper.to_array(tensor)
    finite = np.where(np.isfinite(values), np.clip(values, -LARGEST, LARGEST), values)
    tensor.CopyFrom(numpy_helper.from_array(finite.astype(np.float32), tensor.name))
    return True
