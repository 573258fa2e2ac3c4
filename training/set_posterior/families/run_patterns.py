"""Patterns in which slip or load varies from row to row of a set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def run_patterns(count: int, rows: int, rng: np.random.Generator) -> Floats:
    """Random fractions of the range (count, rows).

    Half of the sets vary independently from row to row, a quarter takes three levels, and a quarter
    is constant.
    """
    independent = rng.random((count, rows))
    levels = rng.random((count, 3))[np.arange(count)[:, None], rng.integers(3, size=(count, rows))]
    constant = np.repeat(rng.random((count, 1)), rows, axis=1)
    pattern = rng.integers(4, size=(count, 1))
    return np.where(pattern < 2, independent, np.where(pattern == 2, levels, constant))
