"""Which rows a fixed-size machine is built on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.regressors.rbf_kernel import rbf

Floats = NDArray[np.float64]

#: Rows that may be chosen, and exchanges that are tried for each one chosen.
CANDIDATES = 4000
TRIALS_PER_CENTRE = 30


def entropy_selected(x: Floats, count: int, width: float, seed: int) -> NDArray[np.int64]:
    r"""Indices (count,) of rows spread so that their quadratic Renyi entropy is large.

    .. math:: H = -\log \frac{1}{m^2} \sum_{ij} k(x_i, x_j)

    A random row replaces a random chosen one wherever that raises H. References: Suykens, Van
    Gestel, De Brabanter, De Moor and Vandewalle, Least Squares Support Vector Machines, World
    Scientific 2002, section 6.2 (fixed-size LS-SVM); Girolami, Neural Computation 14, 2002.
    """
    rng = np.random.default_rng(seed)
    pool = rng.permutation(len(x))[:CANDIDATES]
    if count >= len(pool):
        return np.sort(pool)
    kernel = rbf(x[pool], x[pool], width)
    chosen = np.arange(count)
    outside = np.arange(count, len(pool))
    near = kernel[:, chosen].sum(axis=1)  # each candidate's closeness to the chosen
    for _ in range(TRIALS_PER_CENTRE * count):
        i, j = rng.integers(count), rng.integers(len(outside))
        old, new = chosen[i], outside[j]
        # change of the sum over pairs: the old one's links go, the new one's come
        change = (near[new] - kernel[new, old]) - (near[old] - kernel[old, old])
        if change < 0.0:
            near += kernel[:, new] - kernel[:, old]
            chosen[i], outside[j] = new, old
    return np.sort(pool[chosen])
