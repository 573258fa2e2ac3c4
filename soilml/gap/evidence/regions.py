"""Regions of slip and load in which readings can deviate from a model."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.levels import Levels
from soilml.fitting.readings import Readings

#: Bins along slip and along load of the discrepancy map at most, and readings that a region needs.
SLIP_BINS, LOAD_BINS, MIN_READINGS = 4, 3, 2
MOST_LEFT_OUT = 0.1  # Share of the readings in regions with too few for which fewer bins are made


@dataclass(frozen=True)
class ReadingsRegion:
    """The readings of one channel between two slips and two loads (N)."""

    channel: str
    slip: tuple[float, float]
    load: tuple[float, float]
    selected: NDArray[np.bool_]  # (m,)


def regions(readings: Readings) -> list[ReadingsRegion]:
    """Channel by slip bin by load bin, those with enough readings.

    In as many slip bins as leave no more than `MOST_LEFT_OUT` of the readings in none.
    """
    found = [_regions(readings, count) for count in range(SLIP_BINS, 0, -1)]

    def excess(parts: list[ReadingsRegion]) -> float:
        inside = sum(int(part.selected.sum()) for part in parts)
        return max(1.0 - inside / len(readings), MOST_LEFT_OUT)

    return min(found, key=excess)


def _regions(readings: Readings, slip_bins: int) -> list[ReadingsRegion]:
    """Those of at most `slip_bins` bins of slip."""
    slips = _bins(readings.slip, readings.slip_levels, slip_bins)
    loads = _bins(readings.load, readings.load_levels, LOAD_BINS)
    found = []
    for i, name in enumerate(readings.channels):
        for (low, high), (light, heavy) in product(slips, loads):
            selected = (readings.channel == i) & (readings.slip >= low) & (readings.slip <= high)
            selected &= (readings.load >= light) & (readings.load <= heavy)
            if selected.sum() >= MIN_READINGS:
                found.append(ReadingsRegion(name, (low, high), (light, heavy), selected))
    return found


def _bins(values: Floats, levels: Levels, count: int) -> list[tuple[float, float]]:
    """Bins with nearly equal numbers of levels, from the lowest to the highest value of each."""
    parts = np.array_split(np.arange(levels.count), min(count, levels.count))
    own = [values[np.isin(levels.index, part)] for part in parts]
    return [(float(part.min()), float(part.max())) for part in own]
