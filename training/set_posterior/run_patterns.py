"""How a rover varies slip or load from row to row of a set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def run_patterns(count: int, rows: int, rng: np.random.Generator) -> Floats:
    """Shares of the range (count, rows): anywhere, at three levels, or steady, by chance."""
    anywhere = rng.random((count, rows))
    levels = rng.random((count, 3))[np.arange(count)[:, None], rng.integers(3, size=(count, rows))]
    steady = np.repeat(rng.random((count, 1)), rows, axis=1)
    kind = rng.integers(4, size=(count, 1))
    return np.where(kind < 2, anywhere, np.where(kind == 2, levels, steady))
