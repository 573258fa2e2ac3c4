"""Whether the readings of a set are consistent with one soil, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.set_contract import LEAST_SHARE_IN_RANGE
from training.onnx_graph.value import Value, constant, maximum

#: The limit beyond the largest calibrated number of readings n grows by 1 + 3 / sqrt(n) a reading:
#: that of a chi-squared distribution with n degrees of freedom is n + 3 sqrt(n) to 3 standard
#: deviations, roughly, and a straight line through it lies above it.
CHI_SQUARED_MARGIN = 3.0


@dataclass(frozen=True)
class MisfitLimits:
    """Largest accepted misfit of a set by number of readings, both rising."""

    readings: Floats
    misfit: Floats


@dataclass(frozen=True)
class Consistency:
    """Limits of a set's misfit, and what its rows must satisfy, each (1,)."""

    limit: Value  # largest misfit of sound sets
    enough: Value  # bool: whether there are readings, and at least half of the rows in range


def add_consistency(counts: Value, limits: MisfitLimits) -> Consistency:
    """What a set of so many readings must satisfy.

    The limit is linear in the logarithm of the number of readings between the calibrated numbers.

    counts: Readings in the system, rows, and rows in range, (3,): whole numbers.
    limits: The limits.
    """
    readings, rows, rows_in_range = counts.split([1, 1, 1], axis=0)
    last = int(limits.readings[-1])
    numbers = np.maximum(np.arange(last + 1), limits.readings[0])
    table = np.interp(np.log(numbers), np.log(limits.readings), limits.misfit)
    place = readings.clip(0.0, float(last)).astype(np.int32)
    interpolated = constant(counts.graph, table).node("Gather", place)
    beyond = maximum(readings - float(last), 0.0)
    limit = interpolated + beyond * (1.0 + CHI_SQUARED_MARGIN / np.sqrt(last))
    enough_in_range = rows_in_range >= rows * LEAST_SHARE_IN_RANGE
    any_reading = readings > 0.5  # a count in float32
    return Consistency(limit, enough_in_range & any_reading)
