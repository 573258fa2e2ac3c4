"""Errors that all rows share: what a file assumes, and what a user sets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    MODEL_ERROR_INPUT,
    SENSOR_ERROR_COLUMNS,
)


def read_common_errors(metadata: Mapping[str, Any]) -> dict[str, float]:
    """The usual errors from the entry `set` of a file's metadata; none in earlier versions."""
    if "errors" not in metadata:
        return {}
    errors = metadata["errors"]
    return {name: float(errors[name]) for name in COMMON_ERROR_INPUTS if name in errors}


def error_columns(metadata: Mapping[str, Any]) -> int:
    """Columns of errors in a file's residual system, from the entry `set` of its metadata.

    Files of earlier versions know fewer errors.
    """
    if "errors" not in metadata:
        return 1
    return len(SENSOR_ERROR_COLUMNS) + len(metadata.get("model_errors", ()))


def with_common_errors(usual: Mapping[str, float], given: Mapping[str, Any]) -> dict[str, float]:
    """The errors that a file assumes, with those among the given values that a user sets.

    Raises
    ------
    InputError
        If a value is negative or not finite, or if the file takes what has this error as exact.
    """
    own = {name: float(given[name]) for name in COMMON_ERROR_INPUTS if name in given}
    for name, value in own.items():
        if not 0.0 <= value < np.inf:
            raise InputError(f"{name} is {value:g}; needed is a standard deviation, zero or more")
        check_takes_errors(usual, name, value)
    return {name: own.get(name, value) for name, value in usual.items()}


def check_takes_errors(usual: Mapping[str, float], name: str, std: float) -> None:
    """Raise `InputError` for an error that a file of an earlier version takes no account of."""
    if name == MODEL_ERROR_INPUT and name not in usual and std > 0.0:
        raise InputError(
            f"{name} is {std:g}, but this file takes its model as right; train it again, with "
            "[set_posterior], to have errors of the model taken into account"
        )
    if not usual and std > 0.0:
        raise InputError(
            f"{name} is {std:g}, but this file takes slip, load and the scale of torque as exact; "
            "train it again, with [set_posterior], to have their errors taken into account"
        )
