"""Intervals of mixtures of normal distributions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Probability of the interval by which a mixture is summarised, and its half width in standard
#: deviations of a normal distribution.
COVERAGE, HALF_WIDTH = 0.90, 1.6448536269514722
#: Halvings of the interval in which the half width is sought: a relative error of 1e-9.
HALVINGS = 30


def equivalent_std(offset: Floats, std: Floats, weight: Floats) -> float:
    r"""Standard deviation of the normal distribution with the same central 90 % interval.

    The half width h of the interval about zero holds 90 % of the mixture:

    .. math::
        \sum_i w_i [\Phi((h - \mu_i) / \sigma_i) - \Phi((-h - \mu_i) / \sigma_i)] = 0.9

    A mixture's own standard deviation depends on its tails: where an unlikely component lies far
    away, 1.645 of them hold far more than 90 %.

    Parameters
    ----------
    offset, std, weight : arrays (n,)
        Mean, standard deviation and weight of each component; weights need not sum to one.
    """
    from scipy.special import ndtr

    share = weight / weight.sum()
    low, high = 0.0, float(np.max(np.abs(offset) + HALF_WIDTH * std))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        held = share @ (ndtr((middle - offset) / std) - ndtr((-middle - offset) / std))
        low, high = (middle, high) if held < COVERAGE else (low, middle)
    return 0.5 * (low + high) / HALF_WIDTH
