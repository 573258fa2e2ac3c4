"""Standard error of a ratio of RMSE values on the same sets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def jackknife_rmse_ratio_std(squares: Floats, reference_squares: Floats) -> Floats:
    r"""Jackknife standard error (q,) of the ratio of two RMSE values on the same n sets.

    .. math:: \sigma^2 = \frac{n - 1}{n} \sum_i (r_{(i)} - \bar{r})^2

    with r_(i) the ratio of the RMSE values without set i.

    Parameters
    ----------
    squares, reference_squares
        Squared errors (n, q) of the method and of its reference. They are paired: because both
        errors are correlated, the standard error is smaller than that of either RMSE alone.

    References
    ----------
    Efron and Stein, The jackknife estimate of variance, Annals of Statistics 9, 1981.
    """
    n = len(squares)
    leave_one_out = np.sqrt(
        (squares.sum(axis=0) - squares) / (reference_squares.sum(axis=0) - reference_squares)
    )
    deviations = (leave_one_out - leave_one_out.mean(axis=0)) ** 2
    return np.asarray(np.sqrt((n - 1) / n * deviations.sum(axis=0)))
