"""The metadata entry `together`: calibration of the pooling of single estimates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.onboard.features import READABLE
from soilml.onboard.fusion.held_out_errors import HeldOutErrors
from soilml.onboard.gaussian_pooling import PoolingCalibration, RunConditions, RunPattern

#: Metadata key of each array of `RunConditions`, and of `RunPattern`.
CONDITION_KEYS = {"lower": "lower", "upper": "upper", "std": "std"}
PATTERN_KEYS = {
    "rows": "rows",
    "worth": "information",
    "widening": "std_scale",
    "reach": "coverage_factor",
}


def read_pooling(entry: Mapping[str, Any]) -> PoolingCalibration:
    """The pooling calibration from the metadata entry "together".

    Raises `KeyError`, `TypeError` or `ValueError` where it is malformed.
    """
    names = tuple(entry["over"])
    conditions = RunConditions(
        names=names,
        **{
            field: np.asarray(entry[key], float).reshape(len(names))
            for key, field in CONDITION_KEYS.items()
        },
    )
    if not {*names} <= READABLE.keys():
        raise ValueError("conditions that are no readings")
    alone = np.asarray(entry["alone"], float).reshape(-1)
    patterns = tuple(_read_pattern(kind, len(names), alone.size) for kind in entry["kinds"])
    return PoolingCalibration(
        conditions=conditions,
        patterns=patterns,
        single_row_coverage_factor=alone,
        inconsistency_limits=np.asarray(entry["doubt"], float).reshape(2 if patterns else -1),
        held_out=HeldOutErrors.of(entry["held_out"]) if "held_out" in entry else None,
    )


def _read_pattern(entry: Mapping[str, Any], conditions: int, outputs: int) -> RunPattern:
    arrays = {field: np.asarray(entry[key], float) for key, field in PATTERN_KEYS.items()}
    rows = len(arrays["rows"])
    shapes = [(rows,), (rows,), (rows, outputs), (rows, outputs)]
    varies = tuple(entry["varies"])
    if [array.shape for array in arrays.values()] != shapes or len(varies) != conditions:
        raise ValueError("kinds of another shape")
    return RunPattern(varies=varies, **arrays)


def write_pooling(pooling: PoolingCalibration) -> dict[str, Any]:
    """The metadata entry "together" of a pooling calibration; the inverse of `read_pooling`."""
    conditions = pooling.conditions
    return {
        "over": conditions.names,
        **{key: getattr(conditions, field).tolist() for key, field in CONDITION_KEYS.items()},
        "kinds": [
            {"varies": pattern.varies}
            | {key: getattr(pattern, field).tolist() for key, field in PATTERN_KEYS.items()}
            for pattern in pooling.patterns
        ],
        "alone": pooling.single_row_coverage_factor.tolist(),
        "doubt": pooling.inconsistency_limits.tolist(),
        **({} if pooling.held_out is None else {"held_out": pooling.held_out.entry()}),
    }
