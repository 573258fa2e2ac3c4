"""Random numbers by index: the same whatever pieces of a data set are drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats


def uniform_by_index(seed: tuple[int, ...], index: NDArray[np.int64]) -> Floats:
    """Uniform numbers (n,) in 0 to 1 by ascending index (n,), from a counter-based generator."""
    first, last = int(index[0]), int(index[-1]) + 1
    start = first - first % 4  # Philox generates four words at a time
    generator = np.random.Philox(np.random.SeedSequence(seed))
    generator.advance(start // 4)
    uniform = np.random.Generator(generator).random(last - start)[first - start :]
    return np.asarray(uniform[index - first])


def normal_by_index(seed: tuple[int, ...], index: NDArray[np.int64]) -> Floats:
    """Standard normal numbers (n,) by ascending index (n,)."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.clip(uniform_by_index(seed, index), 1e-16, 1.0 - 1e-16)))
