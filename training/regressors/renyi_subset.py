"""Selection of the rows that become centres of a fixed-size LS-SVM."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.regressors.rbf_kernel import rbf

Floats = NDArray[np.float64]

#: Rows that centres are selected from, and exchanges that are tried per centre.
CANDIDATES = 4000
TRIALS_PER_CENTRE = 30


def select_by_renyi_entropy(x: Floats, count: int, width: float, seed: int) -> NDArray[np.int64]:
    r"""Indices (count,) of rows (n, d) whose quadratic Renyi entropy is large.

    .. math:: H = -\log \frac{1}{m^2} \sum_{ij} k(x_i, x_j)

    A random candidate replaces a random selected row wherever that increases H.

    References
    ----------
    Suykens, Van Gestel, De Brabanter, De Moor and Vandewalle, Least Squares Support Vector
    Machines, World Scientific 2002, section 6.2 (fixed-size LS-SVM); Girolami, Neural Computation
    14, 2002.
    """
    rng = np.random.default_rng(seed)
    candidates = rng.permutation(len(x))[:CANDIDATES]
    if count >= len(candidates):
        return np.sort(candidates)
    kernel = rbf(x[candidates], x[candidates], width)
    selected = np.arange(count)
    others = np.arange(count, len(candidates))
    kernel_sum = kernel[:, selected].sum(axis=1)  # of each candidate with all selected rows
    for _ in range(TRIALS_PER_CENTRE * count):
        i, j = rng.integers(count), rng.integers(len(others))
        old, new = selected[i], others[j]
        # half the change of the sum over pairs, up to the constant diagonal of the kernel
        change = (kernel_sum[new] - kernel[new, old]) - (kernel_sum[old] - kernel[old, old])
        if change < 0.0:
            kernel_sum += kernel[:, new] - kernel[:, old]
            selected[i], others[j] = new, old
    return np.sort(candidates[selected])
