"""Moments and quantiles of a normal distribution in a box."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Points drawn.
POINTS = 2048
#: Standard deviations to which the cumulative normal distribution is tabulated, and its entries.
REACH, ENTRIES = 8.0, 4001
#: Fractions below the ends of the 90 % interval.
INTERVAL = (0.05, 0.95)


@dataclass(frozen=True)
class BoxMoments:
    """Of a distribution of q quantities in a box: moments, 90 % interval, and its mass.

    Attributes
    ----------
    mean, std, low, high
        (q,).
    covariance
        (q, q).
    mass
        Probability of the box before the distribution was cut.
    """

    mean: Floats
    std: Floats
    covariance: Floats
    low: Floats
    high: Floats
    mass: float


def truncated_normal(mean: Floats, covariance: Floats, lower: Floats, upper: Floats) -> BoxMoments:
    r"""A normal distribution of mean (q,) and covariance (q, q), cut to a box (q,).

    Points are drawn one quantity after the other, each from its normal distribution given those
    before, cut to the box; a point weighs as much as the product of the parts that are left:

    .. math:: w = \prod_i \left[\Phi(b_i) - \Phi(a_i)\right]

    The points are the same in each call.

    References
    ----------
    Genz, J. Computational and Graphical Statistics 1(2), 1992; Geweke, Hajivassiliou and Keane
    (the same recursion in econometrics). Points: the additive recurrence of Roberts, 2018.
    """
    grid, cumulative = _normal_table()
    root = np.linalg.cholesky(covariance)
    draws, q = _points(len(mean)), len(mean)
    z, weights = np.zeros((POINTS, q)), np.ones(POINTS)
    for i in range(q):
        centre = mean[i] + z[:, :i] @ root[i, :i]
        a, b = (
            np.interp((end[i] - centre) / root[i, i], grid, cumulative) for end in (lower, upper)
        )
        weights = weights * (b - a)
        z[:, i] = np.interp(a + draws[:, i] * (b - a), cumulative, grid)
    mass = float(weights.mean())
    x = np.clip(mean + z @ root.T, lower, upper)
    weights = weights / weights.sum() if mass > 0.0 else np.full(POINTS, 1.0 / POINTS)
    centre = weights @ x
    deviation = x - centre
    cut = (deviation.T * weights) @ deviation
    low, high = np.asarray([_quantiles(x[:, i], weights) for i in range(q)]).T
    return BoxMoments(centre, np.sqrt(np.diag(cut)), cut, low, high, mass)


def _quantiles(x: Floats, weights: Floats) -> Floats:
    """Weighted quantiles (2,) of points (m,)."""
    order = np.argsort(x, kind="stable")
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    return np.interp(INTERVAL, below, x[order])


@cache
def _normal_table() -> tuple[Floats, Floats]:
    """Points and the cumulative standard normal distribution there."""
    grid = np.linspace(-REACH, REACH, ENTRIES)
    return grid, np.asarray([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in grid])


@cache
def _points(q: int) -> Floats:
    """Evenly spread points (m, q) of the unit cube."""
    ratio = 2.0
    for _ in range(64):  # the root of x^(q+1) = x + 1 above one
        ratio = (1.0 + ratio) ** (1.0 / (q + 1))
    steps = ratio ** -np.arange(1.0, q + 1.0)
    return np.asarray((0.5 + np.arange(1.0, POINTS + 1.0)[:, None] * steps) % 1.0)
