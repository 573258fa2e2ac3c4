"""Cells of rows that were driven nearly alike."""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def cells_of(points: Floats, groups: Integers, most: int) -> Integers:
    """Number of the cell of each of n rows, (n,).

    The cell whose points scatter most, all together, is divided at the mean of the coordinate in
    which they do, until there are `most` cells or the points of each are equal.

    Parameters
    ----------
    points
        Coordinates (n, d), scaled so that their distances compare.
    groups
        Rows of different groups (n,) share no cell.
    most
        Number of cells, of which there are no more unless there are more groups.
    """
    waiting: list[tuple[float, int, int, Integers]] = []
    done: list[Integers] = []

    def put(rows: Integers) -> None:
        scatter, widest = _scatter(points, rows)
        if scatter > 0.0:
            heappush(waiting, (-scatter, int(rows[0]), widest, rows))
        else:
            done.append(rows)

    heapify(waiting)
    for group in np.unique(groups):
        put(np.flatnonzero(groups == group))
    while waiting and len(waiting) + len(done) < most:
        _, _, widest, rows = heappop(waiting)
        values = points[rows, widest]
        low = values <= values.mean()
        if low.all() or not low.any():  # equal but for rounding
            done.append(rows)
            continue
        put(rows[low])
        put(rows[~low])
    cell = np.zeros(len(points), np.int64)
    for number, rows in enumerate([*done, *(entry[3] for entry in waiting)]):
        cell[rows] = number
    return cell


def _scatter(points: Floats, rows: Integers) -> tuple[float, int]:
    """Largest sum of squared distances from the mean of a coordinate, and this coordinate."""
    own = points[rows]
    sums = ((own - own.mean(axis=0)) ** 2).sum(axis=0)
    widest = int(np.argmax(sums))
    return float(sums[widest]), widest
