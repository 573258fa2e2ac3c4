"""Groups of rows that share a part of their error, and folds that leave out whole groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats

Groups = NDArray[np.int64]

#: Fits that leave some rows out. With fewer groups than the third number, a fit without a quarter
#: of them would be clearly worse than that of all: there are more fits then.
FOLDS, MOST_FOLDS, FEW_GROUPS = 4, 20, 300


def few_groups(groups: Groups) -> bool:
    """Whether the rows (n,) are of few groups."""
    return len(np.unique(groups)) < FEW_GROUPS


def folds_of(groups: Groups) -> Groups:
    """Number of the fold (n,) that leaves each row out; rows of one group are in one fold."""
    names, code = np.unique(groups, return_inverse=True)
    count = min(len(names), MOST_FOLDS if few_groups(groups) else FOLDS)
    order = np.random.default_rng(0).permutation(len(names))
    return np.asarray((order % count)[code])


def row_weights(groups: Groups) -> Floats:
    r"""Weights (n,) of rows in a loss, :math:`1 / \sqrt{m}` for m rows of a group, of mean 1.

    Rows of a group say less than as many rows with errors of their own, and more than one.
    """
    _, code, count = np.unique(groups, return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(count[code])
    return np.asarray(weight / weight.mean())
