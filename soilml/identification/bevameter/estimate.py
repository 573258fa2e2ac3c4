"""An estimated quantity: its value, and where it may lie at another place of the soil."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Sizes or loads that differ by less than this factor are meant to be the same.
SAME_LEVEL = 1.03


@dataclass(frozen=True)
class SpreadEstimate:
    """A value with two ranges of 95 %.

    Attributes
    ----------
    value
        The estimate, in `unit`.
    mean_range
        Where the mean of many such tests would lie.
    place_range
        Where the value at another place of the same soil would lie; it contains the scatter from
        test to test, and is what a prior for other runs should be.
    """

    value: float
    mean_range: tuple[float, float]
    place_range: tuple[float, float]
    unit: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in a JSON file."""
        return {
            "value": self.value,
            "mean_95": list(self.mean_range),
            "another_place_95": list(self.place_range),
            "unit": self.unit,
        }


def spread_estimate(value: float, mean: Floats, place: Floats, unit: str) -> SpreadEstimate:
    """The estimate with the ranges of draws of the mean and of another place, (draws,) each."""
    low, high = np.quantile(mean, [0.025, 0.975])
    first, last = np.quantile(place, [0.025, 0.975])
    return SpreadEstimate(value, (float(low), float(high)), (float(first), float(last)), unit)


def distinct_levels(values: Floats) -> tuple[float, ...]:
    """Means of the groups of positive values that are one level but for their scatter."""
    ordered = np.sort(values)
    groups = np.split(ordered, np.flatnonzero(ordered[1:] > SAME_LEVEL * ordered[:-1]) + 1)
    return tuple(float(group.mean()) for group in groups)


def is_level(values: Floats, level: float) -> NDArray[np.bool_]:
    """Which values belong to a level, (k,)."""
    return np.asarray(np.maximum(values / level, level / values) < SAME_LEVEL)
