"""Inputs of a trained model: measured quantities, and ratios of them.

Training and the onboard runtime share this module, so that their inputs are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.onboard.set_contract import Floats
from soilml.quantities import QUANTITIES

#: Quantities that a model can read, with the open interval of possible readings.
READABLE: dict[str, tuple[float, float]] = {
    "slip": (-1.0, 1.0),
    "torque": (-np.inf, np.inf),
    "load": (0.0, np.inf),
    "drawbar_pull": (-np.inf, np.inf),
    "sinkage": (-np.inf, np.inf),
    "vibration": (-np.inf, np.inf),
}
MOST_SHOWN = 40  # A longer argument is cut in an error message


def as_numbers(name: str, value: Any) -> Floats:
    """An argument as an array of float64; raises `InputError` for what is not real numbers."""
    if type(value) is float or (type(value) is np.ndarray and value.dtype == np.float64):
        return np.asarray(value)
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and all(isinstance(x, Real) for x in array.flat):
            array = array.astype(np.float64)
    except (TypeError, ValueError, RuntimeError, OverflowError):
        array = np.asarray(None)
    if array.dtype.kind not in "iuf" or isinstance(value, np.ma.MaskedArray):
        shown = " ".join(repr(value).split())
        shown = shown if len(shown) <= MOST_SHOWN else f"{shown[:MOST_SHOWN]}..."
        raise InputError(f"{name} is {shown}; needed is a number or an array of numbers")
    return array.astype(np.float64, copy=False)


def as_number(name: str, value: Any) -> float:
    """An argument as one number; raises `InputError` for anything else."""
    array = as_numbers(name, value)
    if array.size != 1:
        raise InputError(f"{name} has {array.size} elements; needed is one number")
    return float(array.reshape(()))


def numerator_denominator(feature: str) -> tuple[str, str | None]:
    """Numerator and denominator of a feature: of `torque/load`, or of `slip`, which has none."""
    top, slash, bottom = feature.partition("/")
    for name in (top, bottom if slash else top):
        if name not in READABLE:
            raise InputError(f"feature {feature!r}: {name!r} is none of {', '.join(READABLE)}")
    return top, bottom or None


def inputs_of(features: Sequence[str]) -> tuple[str, ...]:
    """The measured quantities that these features need, in nomenclature order."""
    needed = {name for feature in features for name in numerator_denominator(feature) if name}
    return tuple(name for name in READABLE if name in needed)


def compute_features(features: Sequence[str], measured: Mapping[str, Floats]) -> Floats:
    """Features (rows, d) from measured quantities (rows,)."""
    columns = []
    for feature in features:
        top, bottom = numerator_denominator(feature)
        columns.append(measured[top] / measured[bottom] if bottom else measured[top])
    return np.stack(columns, axis=-1)


def flatten_readings(
    names: Sequence[str], measured: Mapping[str, Any]
) -> tuple[list[Floats], tuple[int, ...]]:
    """The named quantities broadcast and flattened, and the shape they were broadcast to.

    Raises `InputError` for one that is missing, unknown, no number, or outside `READABLE`.
    """
    for name in measured:
        if name not in names:
            raise InputError(f"{name!r} is not read by this model; it reads {', '.join(names)}")
    arrays = []
    for name in names:
        if name not in measured:
            raise InputError(f"{name} is missing; this model reads {', '.join(names)}")
        value, (low, high) = measured[name], READABLE[name]
        array = as_numbers(name, value)
        if type(value) is float and low < value < high:
            arrays.append(array)
            continue
        inside = (array > low) & (array < high)
        if not inside.all():
            bad = ~inside
            unit = QUANTITIES[name].unit
            raise InputError(
                f"{name} is {array[bad].flat[0]:g}; needed is a finite number between "
                f"{low:g} and {high:g} (unit {unit})"
            )
        arrays.append(array)
    shape = arrays[0].shape
    if all(a.shape == shape for a in arrays):
        return [a.reshape(-1) for a in arrays], shape
    try:
        shape = np.broadcast_shapes(*(a.shape for a in arrays))
    except ValueError:
        sizes = ", ".join(f"{n} {a.shape}" for n, a in zip(names, arrays, strict=True))
        raise InputError(f"readings must have one shape, or broadcast; given: {sizes}") from None
    return [np.broadcast_to(a, shape).reshape(-1) for a in arrays], shape


def without_copies(rows: Mapping[str, Floats], readings: Sequence[str]) -> dict[str, Floats]:
    """Rows without those that repeat another in every reading: copies carry no information."""
    count = len(rows[readings[0]])
    # nearly always one reading differs from row to row
    if count < 2 or any(len(set(rows[name].tolist())) == count for name in readings):
        return dict(rows)
    table = np.stack([rows[name] for name in readings], axis=1)
    first = np.sort(np.unique(table, axis=0, return_index=True)[1])
    return {name: values[first] for name, values in rows.items()}
