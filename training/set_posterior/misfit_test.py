"""Whether the readings of a set are consistent with one soil, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.set_contract import LEAST_SHARE_IN_RANGE
from training.onnx_graph.value import Value, log, maximum, minimum

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
    degrees: Value  # degrees of freedom of the misfit
    enough: Value  # bool: whether there are readings, and at least half of the rows in range


def add_consistency(counts: Value, limits: MisfitLimits, unknowns: int) -> Consistency:
    """What a set of so many readings must satisfy.

    The limit is linear in the logarithm of the number of readings between the calibrated numbers.

    counts: Readings in the system, rows, and rows in range, (3,).
    limits: The limits.
    unknowns: Number of estimated unknowns.
    """
    readings, rows, rows_in_range = counts.split([1, 1, 1], axis=0)
    knots = np.log(limits.readings)
    log_readings = log(maximum(readings, limits.readings[0]))
    # a piecewise linear function is the sum of the parts of its segments that are passed
    slopes = np.diff(limits.misfit) / np.diff(knots)
    passed = minimum((log_readings.reshape(1, 1) - knots[:-1]).clip(0.0), np.diff(knots))
    interpolated = (passed * slopes).sum(keepdims=False).reshape(1) + limits.misfit[:1]
    beyond = maximum(readings - limits.readings[-1], 0.0)
    limit: Value = interpolated + beyond * (1.0 + CHI_SQUARED_MARGIN / np.sqrt(limits.readings[-1]))
    enough_in_range = rows_in_range >= rows * LEAST_SHARE_IN_RANGE
    any_reading = readings > 0.5  # a count in float32
    degrees = maximum(readings - float(unknowns), 1.0)
    return Consistency(limit, degrees, enough_in_range & any_reading)
