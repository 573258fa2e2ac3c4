"""Equally weighted samples, Latin hypercubes, and weighted quantiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats


def effective_size(weights: Floats) -> float:
    """Number of equally weighted samples with the same variance of a mean (Kish 1965)."""
    return float(1.0 / np.sum(weights**2))


def systematic_resampling(weights: Floats, count: int, offset: float) -> NDArray[np.int64]:
    r"""Indices (count,) of samples, sample i about count w_i times, by systematic resampling.

    .. math:: i_k = \min\{i : \textstyle\sum_{j \le i} w_j \ge (k + \text{offset}) / N\}

    weights: Weights (n,) that sum to one up to rounding.
    count: Number N of indices.
    offset: Uniform draw from [0, 1) for an unbiased sample; 0.5 for a deterministic one.

    References: Carpenter, Clifford and Fearnhead, IEE Proc. Radar, Sonar and Navigation 146(1),
    1999.
    """
    cumulative = np.cumsum(weights)
    position = (offset + np.arange(count)) / count * cumulative[-1]
    return np.asarray(np.minimum(np.searchsorted(cumulative, position), len(weights) - 1))


def latin_hypercube(count: int, p: int, rng: np.random.Generator) -> Floats:
    """Points (count, p) in the unit cube, one in each of `count` strata of every axis.

    References: McKay, Beckman and Conover, Technometrics 21(2), 1979.
    """
    strata = np.stack([rng.permutation(count) for _ in range(p)], axis=1)
    return np.asarray((strata + rng.random((count, p))) / count)


def weighted_quantiles(values: Floats, weights: Floats, fractions: Floats) -> Floats:
    """Quantiles (k, q) at `fractions` (k,) of the columns of `values` (n, q) under weights (n,).

    The empirical distribution function is interpolated between the mid-points of its steps.
    """
    order = np.argsort(values, axis=0)
    ranked = np.take_along_axis(values, order, axis=0)
    cumulative = np.cumsum(weights[order], axis=0) - 0.5 * weights[order]
    columns = zip(cumulative.T, ranked.T, strict=True)
    return np.stack([np.interp(fractions, c, v) for c, v in columns], axis=1)
