"""An estimate given that the soil lies in a box within its prior."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from soilml.errors import InputError
from soilml.onboard.features import as_numbers
from soilml.onboard.set_contract import Floats

POINTS = 2048  # Points drawn
#: Standard deviations to which the cumulative normal distribution is tabulated, and its entries.
REACH, ENTRIES = 8.0, 4001
INTERVAL = (0.05, 0.95)  # Fractions below the ends of the 90 % interval
#: Standard deviation, in widths of the prior, of the likelihood of a quantity that the readings do
#: not determine.
NO_INFORMATION = 20.0
LEAST_MASS = 1e-4  # Share of the estimate in the box below which the readings contradict it


@dataclass(frozen=True)
class BoxMoments:
    """Of a distribution of q quantities in a box: moments, 90 % interval, and its mass.

    mean, std, low, high: (q,).
    covariance: (q, q).
    mass: Probability of the box before the distribution was cut.
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

    References: Genz, J. Computational and Graphical Statistics 1(2), 1992; Geweke, Hajivassiliou
    and Keane (the same recursion in econometrics). Points: the additive recurrence of Roberts,
    2018.
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


def within_box(
    mean: Floats,
    covariance: Floats,
    interval: Floats,
    prior: tuple[Floats, Floats],
    box: tuple[Floats, Floats],
) -> BoxMoments:
    r"""Moments and 90 % interval of q quantities of which a narrower uniform prior is known.

    The likelihood is taken as normal: the estimate's precision less that of its uniform
    prior. Cut to the prior it should give the estimate back; the difference, which stems from an
    estimate that is not normal, is carried over to the cut by the box.

    mean, covariance: Estimate, (q,) and (q, q).
    interval: Ends of its 90 % interval, (2, q).
    prior, box: Ends of the uniform prior of the estimate, and of the narrower one; (q,) each.
    """
    width = prior[1] - prior[0]
    readings_mean, readings_covariance = _without_prior(mean, covariance, *prior)
    before = truncated_normal(readings_mean, readings_covariance, *prior)
    after = truncated_normal(readings_mean, readings_covariance, *box)
    least = 1e-9 * width
    scale = np.sqrt(np.diag(covariance)) / np.maximum(before.std, least)
    std = np.minimum(after.std * scale, 0.5 * (box[1] - box[0]))
    correlation = after.covariance / np.outer(*2 * (np.maximum(after.std, least),))
    shift = mean - before.mean
    # a quantity that the box fixes is not moved by what its estimate was off by
    left = np.clip(after.std / np.maximum(before.std, least), 0.0, 1.0)
    return BoxMoments(
        mean=np.clip(after.mean + left * shift, *box),
        std=std,
        covariance=correlation * np.outer(std, std),
        low=np.clip(after.low + left * (interval[0] - before.low), *box),
        high=np.clip(after.high + left * (interval[1] - before.high), *box),
        mass=after.mass / max(before.mass, 1e-300),
    )


def _without_prior(
    mean: Floats, covariance: Floats, lower: Floats, upper: Floats
) -> tuple[Floats, Floats]:
    """Mean and covariance of the likelihood, as if it were normal."""
    width = upper - lower
    scaled = covariance / np.outer(width, width)
    precision = np.linalg.inv(scaled)
    own = precision - 12.0 * np.eye(len(mean))
    size, vectors = np.linalg.eigh(0.5 * (own + own.T))
    size = np.maximum(size, NO_INFORMATION**-2)
    found = (vectors / size) @ vectors.T
    pull = precision @ ((mean - lower) / width) - 12.0 * 0.5
    centre = np.clip(found @ pull, -NO_INFORMATION, NO_INFORMATION)
    return lower + width * centre, found * np.outer(width, width)


def box_ends(
    names: Sequence[str],
    units: Sequence[str],
    prior: tuple[Floats, Floats],
    box: Mapping[str, tuple[float, float]],
) -> tuple[Floats, Floats]:
    """Ends (q,) of the box; raises `InputError` where they are not in the prior and in order."""
    lower, upper = prior[0].copy(), prior[1].copy()
    for name, ends in box.items():
        if name not in names:
            raise InputError(f"{name!r} is not estimated; there are: {', '.join(names)}")
        i = names.index(name)
        given = as_numbers(name, ends)
        if given.shape != (2,):
            raise InputError(f"{name} within {ends!r}; needed are two values, (least, largest)")
        low, high = float(given[0]), float(given[1])
        if not lower[i] <= low < high <= upper[i]:
            raise InputError(
                f"{name} within {low:g} to {high:g} {units[i]}; needed are two values in "
                f"order within the prior, {lower[i]:g} to {upper[i]:g} {units[i]}"
            )
        lower[i], upper[i] = low, high
    return lower, upper
