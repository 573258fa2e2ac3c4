"""Smooth functions by which readings can deviate from a model, and regions of slip and load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.levels import Levels
from soilml.fitting.readings import Readings

#: Degrees in slip and in log load of the smooth functions: enough for one maximum and one
#: inflection over slip, and for a curvature over load.
SLIP_DEGREE, LOAD_DEGREE = 4, 2
#: Readings of a channel per smooth function, so that noise cannot be fitted.
READINGS_PER_FUNCTION = 4
#: The same where noise is told from what is smooth, in channels with few readings, and the number
#: of functions up to which a channel has few.
READINGS_PER_FUNCTION_OF_FEW, FUNCTIONS_OF_FEW = 2, 4
#: Bins along slip and along load of the discrepancy map at most, and readings that a region needs.
SLIP_BINS, LOAD_BINS, MIN_READINGS = 4, 3, 2
MOST_LEFT_OUT = 0.1  # Share of the readings in regions with too few for which fewer bins are made


def smooth_basis(readings: Readings) -> Floats:
    """Products of Legendre polynomials of slip and log load for each channel and gear, (m, q).

    Each column is in the unit of its channel's noise. The degree is limited by the number of
    levels of slip and load.
    """
    return _smooth_functions(readings, lambda count: count // READINGS_PER_FUNCTION)


def smooth_basis_of_few(readings: Readings) -> Floats:
    """The same, of up to four functions for each channel with fewer readings than sixteen, (m, q).

    Two readings per function: they leave what is rough in few rows, from which noise is estimated.
    Channels with more readings have none.
    """

    def most(count: int) -> int:
        few = count // READINGS_PER_FUNCTION < FUNCTIONS_OF_FEW
        return min(count // READINGS_PER_FUNCTION_OF_FEW, FUNCTIONS_OF_FEW) if few else 0

    return _smooth_functions(readings, most)


def _smooth_functions(readings: Readings, most: Callable[[int], int]) -> Floats:
    """So many functions of each channel and gear, by the number of its readings, (m, q)."""
    slip, load = _scaled(readings.slip), _scaled(np.log(readings.load))
    degrees = (
        min(SLIP_DEGREE, readings.slip_levels.count - 1),
        min(LOAD_DEGREE, readings.load_levels.count - 1),
    )
    columns = []
    for channel, gear in product(range(len(readings.channels)), np.unique(readings.gear)):
        in_channel = (readings.channel == channel) & (readings.gear == gear)
        for i, j in _orders(*degrees)[: most(int(in_channel.sum()))]:
            basis = np.polynomial.legendre.Legendre.basis(i)(slip)
            basis = basis * np.polynomial.legendre.Legendre.basis(j)(load)
            std = np.median(readings.std[in_channel])
            columns.append(np.where(in_channel, basis, 0.0) * std)
    return np.stack(columns, axis=1) if columns else np.zeros((len(readings), 0))


def _orders(slip: int, load: int) -> list[tuple[int, int]]:
    """Orders of the products up to the larger degree in total, the smoothest first."""
    pairs = [(i, j) for i in range(slip + 1) for j in range(load + 1) if i + j <= max(slip, load)]
    return sorted(pairs, key=lambda pair: (pair[0] + pair[1], pair[1]))


def _scaled(values: Floats) -> Floats:
    """Values mapped to -1 to 1, the interval on which Legendre polynomials are orthogonal."""
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / (high - low) - 1.0 if high > low else np.zeros_like(values)


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
