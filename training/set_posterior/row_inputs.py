"""Inputs of a set posterior as a caller may feed them, made complete and finite in the graph.

A caller without `soilml.Estimator`, for example one in C, may leave inputs out, feed one value for
all rows, or feed what a failing sensor gives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.set_contract import (
    ABSENT_READING,
    ABSENT_STD,
    DAMAGED_COUNTS,
    LEAST_STD,
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    NOISE_OF_FILE,
    NOT_MEASURED,
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    OPTIONAL_READINGS,
    READING_INPUTS,
    RESPONSE_CHANNELS,
)
from training.onnx_graph.value import Value, absolute, composite, concat, constant, sqrt, where

#: Standard deviations of the noise of the channels, in their order.
CHANNEL_STDS = tuple(f"{name}_std" for name in RESPONSE_CHANNELS)
#: All standard deviations of a row, those of the channels first, and those that may be zero.
ROW_STDS = (*CHANNEL_STDS, "torque_bias", *OPERATING_STD_INPUTS)
MAY_BE_ZERO = ("torque_bias", *OPERATING_STD_INPUTS)
#: All inputs by row in the order in which they are stacked: slip, load, channels, and the others.
ROWS = (*READING_INPUTS, *ROW_STDS)
#: Constant part and share of the reading of each noise of a file, by the names of `NOISE_NAMES`.
FileNoise = Mapping[str, Sequence[float]]

#: Sums of inputs by row up to this are finite in float32; one with NaN or an infinity is not below
#: it. Context inputs, and sums of squares of a state, are far smaller than this, so that their
#: products are finite too.
LARGEST_SUM, LARGEST_CONTEXT, LARGEST_MEMORY = 3e38, 1e9, 1e30
SENSELESS = 3.2e38  # Stands for the sum of a row's inputs where a context input is senseless
#: Readings are limited to this: they are as impossible, and float32 tells them from an
#: error that all readings share.
LARGEST_READING = 1e8
IMPOSSIBLE_SLIP = -1.0  # Slip of a row that is not finite: out of every range
#: Values of a row that is not finite.
HARMLESS = np.asarray([[IMPOSSIBLE_SLIP if name == "slip" else 1.0] for name in ROWS])
MARKER_SHARE = 0.5  # Readings below this share of the marker were not measured
#: Standard deviation of a reading that was not measured: on the scale of every response, also of
#: drawbar pull over any load, it is far beyond what is used, and its square is finite.
NO_WEIGHT_STD = 1e15


def default_values() -> dict[str, NDArray[Any]]:
    """Values of the inputs by row that need not be fed, (1,) each."""
    values = dict.fromkeys(OPTIONAL_READINGS, NOT_MEASURED)
    values |= dict.fromkeys(ROW_STDS, NOISE_OF_FILE)
    return {name: np.full(1, value, np.float32) for name, value in values.items()}


def complete_inputs(
    inputs: Mapping[str, Value],
    context: Sequence[str],
    noise: FileNoise,
    positive: Sequence[str] = (),
) -> dict[str, Value]:
    r"""Inputs by row (1, rows), without markers, and everything finite.

    - An input of one element is that of all rows.
    - A row of which any input is not finite gets a slip that is out of range, and harmless values.
    - A context input that is not finite, or senseless, puts all rows out of range; a state that is
      not finite is replaced by counts that no set can outweigh (`DAMAGED_COUNTS`), so that the set
      stays refused.
    - A negative standard deviation, and one below `LEAST_STD` unless it may be zero, becomes that
      of the file's noise: a torque of zero, whose logarithm is that of `LEAST_STD`, is then noise,

    .. math:: \sigma = \sqrt{\sigma_{constant}^2 + (\sigma_{share} y)^2}

    - A reading that was not measured becomes one with a standard deviation that gives it no weight;
      a larger one than any sensor gives is limited.

    inputs: All inputs of the graph.
    context: Names of those of a whole set.
    positive: Those of them that must be above zero.
    noise: Noise of the file.
    """
    complete = dict(inputs)
    by_row = [inputs[name] for name in ROWS]
    total = by_row[0].node("Sum", *by_row[1:])  # (rows,), also where some have one element
    rows = total.node("Shape")
    if context:
        values = concat([inputs[name] for name in context], axis=0)
        squares = values.sum_of_squares(keepdims=True)  # (1,): large values do not cancel
        sensible = squares <= LARGEST_CONTEXT**2
        if positive:
            least = values.take([context.index(name) for name in positive], axis=0)
            sensible = sensible & (least.reduce("ReduceMin", axis=0, keepdims=True) > 0.0)
        values = where(sensible, values, 1.0)
        complete |= zip(context, values.split(len(context), axis=0), strict=True)
        total = where(sensible, total, SENSELESS)
    finite = absolute(total) <= LARGEST_SUM
    whole = concat([value.node("Expand", rows) for value in by_row], axis=0).reshape(len(ROWS), -1)
    stacked = where(finite, whole, constant(total.graph, HARMLESS))
    state, counts = (inputs[name] for name in MEMORY_INPUTS)
    sound = composite("SoundMemory", MEMORY_OUTPUTS, _sound, state=state, counts=counts)
    complete |= zip(MEMORY_INPUTS, sound, strict=True)
    return complete | _without_markers(stacked, noise)


def _sound(state: Value, counts: Value) -> list[Value]:
    """A state and counts that are finite."""
    squares = state.sum_of_squares(keepdims=False) + counts.sum_of_squares(keepdims=False)
    intact = squares <= LARGEST_MEMORY
    return [where(intact, state, 0.0), where(intact, counts, np.asarray(DAMAGED_COUNTS))]


def _without_markers(stacked: Value, noise: FileNoise) -> dict[str, Value]:
    """Slip and load, and channels and standard deviations without markers, (1, rows)."""
    k, others = len(RESPONSE_CHANNELS), len(ROW_STDS) - len(RESPONSE_CHANNELS)
    operating, _, std = stacked.split([len(OPERATING_NOISE), k, len(ROW_STDS)], axis=0)
    read = [ROWS.index(reading_of(name)) for name in ROW_STDS]
    reading = stacked.take(read, axis=0)  # (stds, rows)
    parts = np.asarray([noise_of(name, noise) for name in ROW_STDS])
    may_be_zero = np.asarray([[name in MAY_BE_ZERO] for name in ROW_STDS])
    least = np.where(may_be_zero, 0.0, LEAST_STD)
    own = reading * parts[:, 1:]
    own = sqrt(own * own + np.maximum(parts[:, :1], least) ** 2)
    std = where(std < least, own, std)
    marked = reading < MARKER_SHARE * NOT_MEASURED
    no_weight = constant(std.graph, np.where(may_be_zero, ABSENT_STD, NO_WEIGHT_STD))
    std = where(marked | (std >= ABSENT_STD), no_weight, std)
    channels = where(marked, constant(std.graph, ABSENT_READING), reading)
    channels = channels.clip(-LARGEST_READING, LARGEST_READING)
    groups = [
        (OPERATING_NOISE, operating.clip(-LARGEST_READING, LARGEST_READING)),
        (RESPONSE_CHANNELS, channels.split([k, others], axis=0)[0]),
    ]
    of_channels, bias, of_operating = std.split([k, 1, others - 1], axis=0)
    groups += [(CHANNEL_STDS, of_channels), (OPERATING_STD_INPUTS, of_operating)]
    rows = {
        name: row
        for names, group in groups
        for name, row in zip(names, group.split(len(names), axis=0), strict=True)
    }
    return rows | {"torque_bias": bias}


def reading_of(name: str) -> str:
    """The reading that a standard deviation is of: torque of torque_std and torque_bias."""
    return name.rpartition("_")[0]


def noise_of(name: str, noise: FileNoise) -> tuple[float, float]:
    """Constant part and share of the file's noise for a standard deviation."""
    reading = reading_of(name)
    constant_part, share = noise.get(reading if name.endswith("_std") else name, (0.0, 0.0))
    if reading in OPTIONAL_READINGS and not constant_part + share:
        return ABSENT_STD, 0.0
    return float(constant_part), float(share)
