"""Drawbar pull from an estimate of the soil, with its 90 % interval."""

from __future__ import annotations

import numpy as np
from lunar.sweep import NAMES, Floats, bounds, wheel_forces

from soilml import Case

#: Samples drawn per sample returned: of a Gaussian at a corner of the prior an eighth lies inside.
SPARE = 6


def sample_soils(
    case: Case, mean: Floats, covariance: Floats, rng: np.random.Generator, count: int
) -> Floats:
    """Samples (count, ..., p) of Gaussians (..., p) and (..., p, p), truncated to the prior.

    If fewer than `count` samples lie inside, they are repeated. Where p is 3 and the prior has a
    bearing too, that is drawn from its prior: (count, ..., 4).
    """
    lower, upper = bounds(case, mean.shape[-1])
    scale = upper - lower
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale)) * scale[:, None]
    normal = rng.standard_normal((SPARE * count, *mean.shape))
    values = mean + np.einsum("...ij,m...j->m...i", factor, normal)
    outside = np.any((values < lower) | (values > upper), axis=-1)
    order = np.argsort(outside, axis=0, kind="stable")
    turn = np.arange(count).reshape(-1, *[1] * (mean.ndim - 1))
    place = np.take_along_axis(order, turn % np.maximum((~outside).sum(axis=0), 1), axis=0)
    found = np.clip(np.take_along_axis(values, place[..., None], axis=0), lower, upper)
    unknown = [case.prior[name] for name in NAMES[mean.shape[-1] :] if name in case.prior]
    rest = [prior.at(rng.random(found.shape[:-1])) for prior in unknown]
    return np.concatenate([found, *(values[..., None] for values in rest)], axis=-1)


def pull_interval(
    case: Case,
    mean: Floats,
    covariance: Floats,
    slip: Floats,
    load: float,
    rng: np.random.Generator,
    count: int = 800,
) -> tuple[Floats, Floats, Floats]:
    """Drawbar pull (N) predicted from estimates (..., p) at slips (...): mean and 90 % interval.

    What the estimates do not contain is drawn from its prior, or known.
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
    """Estimates (..., p) repeated for each slip: (..., slips, p)."""
    shape = (*mean.shape[:-1], slips, mean.shape[-1])
    wide = np.broadcast_to(covariance[..., None, :, :], (*shape, mean.shape[-1]))
    return np.broadcast_to(mean[..., None, :], shape), wide
