"""Soils drawn from an estimate: a mean and a covariance within the range of a prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.identification.free_parameters import FreeParameter
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.traction.soil_draws import COUNT, SoilDraws, systematic_resampling

Floats = NDArray[np.float64]

#: Means and products of the draws agree with the estimate to this share of its widths.
AGREED = 1e-4
MOST_STEPS = 60
#: Effective samples below which no step is taken: the estimate has moments that no density in the
#: range has.
FEWEST = 200.0


def estimated_draws(
    free: Sequence[FreeParameter],
    mean: Floats,
    covariance: Floats,
    count: int = COUNT,
    seed: int = 0,
) -> SoilDraws:
    r"""Soils of the widest density in the range that has this mean (p,) and covariance (p, p).

    .. math:: p(u) \propto \exp(\lambda^\top u + u^\top \Lambda u), \quad u \in [0, 1]^p

    The density of most entropy among those with the given moments: a narrow estimate is a
    Gaussian, and one as wide as the prior is the uniform prior itself, which a Gaussian cut off at
    the range is not. Moments that no density in the range has are met as nearly as samples allow.
    Priors must be linear. References: Jaynes, Phys. Rev. 106, 1957. Raises `InputError` for a
    covariance that is none and for a mean outside the range.
    """
    low = np.asarray([f.prior.lower for f in free])
    wide = np.asarray([f.prior.upper for f in free]) - low
    middle, spread = (mean - low) / wide, covariance / np.outer(wide, wide)
    if not (np.isfinite(spread).all() and np.linalg.eigvalsh(spread).min() > 0.0):
        raise InputError("the estimate's covariance is not positive; needed is one of a spread")
    if not ((middle >= 0.0) & (middle <= 1.0)).all():
        name = free[int(np.argmax(np.abs(middle - 0.5)))].path
        raise InputError(f"the estimate of {name} lies outside its range; needed is one inside")
    factor = np.linalg.cholesky(spread)

    def white(u: Floats) -> Floats:
        return np.asarray(np.linalg.solve(factor, (u - middle).T).T)

    found = importance_sample(lambda u: -0.5 * (white(u) ** 2).sum(axis=1), len(free), seed)
    rows = systematic_resampling(_tilted(found, white(found.u)), count, np.random.default_rng(seed))
    return SoilDraws(tuple(f.path for f in free), low + wide * found.u[rows])


def _tilted(found: ImportanceSample, white: Floats) -> ImportanceSample:
    """The samples weighed anew, so that `white` (n, p) has mean 0 and covariance 1.

    Newton steps on the convex dual, log sum w exp(lambda f) - lambda f_0.
    """
    p = white.shape[1]
    i, j = np.triu_indices(p)
    features = np.hstack([white, white[:, i] * white[:, j]])
    features -= np.concatenate([np.zeros(p), (i == j).astype(float)])
    multipliers = np.zeros(features.shape[1])
    best, height = found, _height(found, features, multipliers)[0]
    for _ in range(MOST_STEPS):
        off = best.mean(features)
        if np.abs(off).max() < AGREED:
            break
        centred = features - off
        hessian = (centred.T * best.weights) @ centred
        step = np.linalg.solve(hessian + 1e-9 * np.trace(hessian) * np.eye(len(off)), off)
        for share in 0.5 ** np.arange(12):
            tried, new = _height(found, features, multipliers - share * step)
            if tried < height and new.effective >= FEWEST:
                best, height, multipliers = new, tried, multipliers - share * step
                break
        else:
            break
    return best


def _height(
    found: ImportanceSample, features: Floats, multipliers: Floats
) -> tuple[float, ImportanceSample]:
    """The dual at some multipliers, and the samples with the weights that go with them."""
    logs = features @ multipliers
    top = float(logs.max())
    weights = found.weights * np.exp(logs - top)
    total = float(weights.sum())
    if not total > 0.0:
        return float("inf"), found
    return top + float(np.log(total)), replace(found, weights=weights / total)
