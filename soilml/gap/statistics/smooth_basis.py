"""Shapes that no catalogue has: smooth in slip and load, or local to a corner of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.gap.data.observations import Cells, distinct

Floats = NDArray[np.float64]

#: Degrees in slip and in log load of the smooth columns.
SLIP_DEGREE, LOAD_DEGREE = 4, 2
#: Bins along slip and along load of the map.
SLIP_BINS, LOAD_BINS = 4, 3


def smooth_columns(cells: Cells) -> Floats:
    """Products of Legendre polynomials of slip and log load for each channel, (m, q).

    In the unit of each cell's noise. The degree falls where few values were driven.
    """
    slip, load = _unit(cells.slip), _unit(np.log(cells.load))
    most = (_degree(slip, SLIP_DEGREE), _degree(load, LOAD_DEGREE))
    columns = []
    for channel in range(len(cells.channels)):
        here = cells.channel == channel
        room = int(here.sum()) // 4
        for i, j in _orders(*most)[:room]:
            basis = np.polynomial.legendre.Legendre.basis(i)(slip)
            basis = basis * np.polynomial.legendre.Legendre.basis(j)(load)
            columns.append(np.where(here, basis, 0.0) * np.median(cells.std[here]))
    return np.stack(columns, axis=1) if columns else np.zeros((len(cells), 0))


def _orders(slip: int, load: int) -> list[tuple[int, int]]:
    """Orders of the products, the smoothest first."""
    pairs = [(i, j) for i in range(slip + 1) for j in range(load + 1) if i + j <= max(slip, load)]
    return sorted(pairs, key=lambda pair: (pair[0] + pair[1], pair[1]))


def _unit(values: Floats) -> Floats:
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / (high - low) - 1.0 if high > low else np.zeros_like(values)


def _degree(unit: Floats, most: int) -> int:
    """The degree that the distinct values can carry."""
    return int(min(most, distinct(unit) - 1))


@dataclass(frozen=True)
class Place:
    """A corner of the data: one channel, between two slips and two loads (N)."""

    channel: str
    slip: tuple[float, float]
    load: tuple[float, float]
    cells: NDArray[np.bool_]


def places(cells: Cells) -> Iterator[Place]:
    """Channel by slip bin by load bin, those with two cells at least."""
    slips, loads = _edges(cells.slip, SLIP_BINS), _edges(cells.load, LOAD_BINS)
    for i, name in enumerate(cells.channels):
        for low, high in slips:
            for light, heavy in loads:
                here = (cells.channel == i) & (cells.slip >= low) & (cells.slip <= high)
                here &= (cells.load >= light) & (cells.load <= heavy)
                if here.sum() >= 2:
                    yield Place(name, (low, high), (light, heavy), here)


def _edges(values: Floats, bins: int) -> list[tuple[float, float]]:
    """Bins of about as many cells each, by the values that were driven."""
    ordered = np.unique(values)
    parts = np.array_split(ordered, min(bins, distinct(values)))
    return [(float(part[0]), float(part[-1])) for part in parts if part.size]
