"""Drawbar pull from an estimate of the soil, with its 90 % interval."""

from __future__ import annotations

import numpy as np
from lunar.sweep import Floats, bounds, wheel_forces

from soilml import Case

#: Samples drawn per sample returned: of a Gaussian at a corner of the prior an eighth lies inside.
SPARE = 6


def sample_soils(
    case: Case, mean: Floats, covariance: Floats, rng: np.random.Generator, count: int
) -> Floats:
    """Samples (count, ..., 3) of Gaussians (..., 3) and (..., 3, 3), truncated to the prior.

    If fewer than `count` samples lie inside, they are repeated.
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


def pull_interval(
    case: Case,
    mean: Floats,
    covariance: Floats,
    slip: Floats,
    load: float,
    rng: np.random.Generator,
    count: int = 800,
) -> tuple[Floats, Floats, Floats]:
    """Drawbar pull (N) predicted from estimates (..., 3) at slips (...): mean and 90 % interval.

    The bearing parameters are those of the case; the uncertainty of the shear parameters is
    propagated by sampling.
    """
    pull = wheel_forces(
        case, sample_soils(case, mean, covariance, rng, count), slip, load
    ).drawbar_pull
    return mean_and_interval(pull)


def mean_and_interval(draws: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean of samples (count, ...), and the ends of their 90 % interval."""
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    return draws.mean(axis=0), low, high


def repeat_over_slips(mean: Floats, covariance: Floats, slips: int) -> tuple[Floats, Floats]:
    """Estimates (..., 3) repeated for each slip: (..., slips, 3)."""
    shape = (*mean.shape[:-1], slips, 3)
    wide = np.broadcast_to(covariance[..., None, :, :], (*shape, 3))
    return np.broadcast_to(mean[..., None, :], shape), wide
