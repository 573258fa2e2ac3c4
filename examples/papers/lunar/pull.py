"""Drawbar pull from an estimate of the soil, with its band."""

from __future__ import annotations

import numpy as np
from lunar.sweep import Floats, bounds, driven

from soilml import Case

#: Soils drawn for one that is kept: a Gaussian at a corner of the prior has an eighth inside.
SPARE = 6


def drawn(
    case: Case, mean: Floats, covariance: Floats, rng: np.random.Generator, count: int
) -> Floats:
    """Soils (count, ..., 3) of Gaussians (..., 3) and (..., 3, 3), those inside the prior's range.

    Where fewer than `count` of the draws lie inside, they are taken more than once.
    """
    lower, upper = bounds(case)
    scale = upper - lower
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale)) * scale[:, None]
    normal = rng.standard_normal((SPARE * count, *mean.shape))
    values = mean + np.einsum("...ij,m...j->m...i", factor, normal)
    outside = np.any((values < lower) | (values > upper), axis=-1)
    order = np.argsort(outside, axis=0, kind="stable")
    turn = np.arange(count).reshape(-1, *[1] * (mean.ndim - 1))
    place = np.take_along_axis(order, turn % np.maximum((~outside).sum(axis=0), 1), axis=0)
    return np.clip(np.take_along_axis(values, place[..., None], axis=0), lower, upper)


def band(
    case: Case,
    mean: Floats,
    covariance: Floats,
    slip: Floats,
    load: float,
    rng: np.random.Generator,
    count: int = 800,
) -> tuple[Floats, Floats, Floats]:
    """Drawbar pull (N) that estimates (..., 3) foretell at slips (...): mean, and 90 % between.

    The soil's bearing is that of the case; what the estimates leave open of the shear parameters is
    carried by draws.
    """
    pull = driven(case, drawn(case, mean, covariance, rng, count), slip, load).drawbar_pull
    return spread(pull)


def spread(draws: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean of draws (count, ...), and the ends of what holds 90 % of them."""
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    return draws.mean(axis=0), low, high


def everywhere(mean: Floats, covariance: Floats, slips: int) -> tuple[Floats, Floats]:
    """Estimates (..., 3) of whole drives, repeated for each of their slips: (..., slips, 3)."""
    shape = (*mean.shape[:-1], slips, 3)
    wide = np.broadcast_to(covariance[..., None, :, :], (*shape, 3))
    return np.broadcast_to(mean[..., None, :], shape), wide
