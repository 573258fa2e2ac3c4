"""Selection of the rows that become centres of a fixed-size LS-SVM."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from training.regressors.kernel.rbf_kernel import rbf

Floats = NDArray[np.float64]

#: Rows that centres are selected from, at least and for each centre; and exchanges per centre.
CANDIDATES, CANDIDATES_PER_CENTRE = 4000, 10
TRIALS_PER_CENTRE = 30


def select_by_renyi_entropy(x: Floats, count: int, width: float, seed: int) -> NDArray[np.int64]:
    r"""Indices (count,) of rows (n, d) whose quadratic Renyi entropy is large.

    .. math:: H = -\log \frac{1}{m^2} \sum_{ij} k(x_i, x_j)

    A random candidate replaces a random selected row wherever that increases H. Columns of the
    kernel matrix of the candidates are computed as they are needed.

    References
    ----------
    Suykens, Van Gestel, De Brabanter, De Moor and Vandewalle, Least Squares Support Vector
    Machines, World Scientific 2002, section 6.2 (fixed-size LS-SVM); Girolami, Neural Computation
    14, 2002.
    """
    rng = np.random.default_rng(seed)
    candidates = rng.permutation(len(x))[: max(CANDIDATES, CANDIDATES_PER_CENTRE * count)]
    if count >= len(candidates):
        return np.sort(candidates)
    scaled = x[candidates] / (math.sqrt(2.0) * width)
    points = scaled.tolist()
    selected = np.arange(count)
    others = np.arange(count, len(candidates))
    # of each candidate with all selected rows
    kernel_sum = rbf(x[candidates], x[candidates[selected]], width).sum(axis=1)

    def column(row: int) -> Floats:
        return np.asarray(np.exp(-((scaled - scaled[row]) ** 2).sum(axis=1)))

    trials = TRIALS_PER_CENTRE * count
    pairs = zip(
        rng.integers(count, size=trials), rng.integers(len(others), size=trials), strict=True
    )
    for i, j in pairs:
        old, new = selected[i], others[j]
        between = math.exp(-(math.dist(points[old], points[new]) ** 2))
        # half the change of the sum over pairs; the diagonal of the kernel is 1
        if kernel_sum[new] - between < kernel_sum[old] - 1.0:
            kernel_sum += column(new) - column(old)
            selected[i], others[j] = new, old
    return np.sort(candidates[selected])
