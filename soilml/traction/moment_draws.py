"""Draws of soil parameters with a given mean and covariance, inside a prior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.maximum_entropy import moment_matched_weights
from soilml.numerics.resampling import systematic_resampling
from soilml.traction.soil_draws import DRAWS, SoilDraws

Floats = NDArray[np.float64]


def estimated_draws(
    free: Sequence[Coordinate],
    mean: Floats,
    covariance: Floats,
    count: int = DRAWS,
    seed: int = 0,
) -> SoilDraws:
    r"""Draws of the maximum-entropy density in the prior with this mean (p,) and covariance (p, p).

    .. math:: p(u) \propto \exp(\lambda^\top u + u^\top \Lambda u), \quad u \in [0, 1]^p

    A narrow estimate gives a Gaussian, one as wide as the prior the uniform prior itself, which a
    truncated Gaussian does not. Moments that no density in the range has are met as nearly as
    samples allow. Priors must be uniform, not logarithmic.

    Raises
    ------
    InputError
        For a covariance that is not positive definite, or a mean outside the range.

    References
    ----------
    Jaynes, Phys. Rev. 106, 1957.
    """
    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    middle, spread = (mean - low) / width, covariance / np.outer(width, width)
    if not (np.isfinite(spread).all() and np.linalg.eigvalsh(spread).min() > 0.0):
        raise InputError("the covariance of the estimate is not positive definite")
    if not ((middle >= 0.0) & (middle <= 1.0)).all():
        name = free[int(np.argmax(np.abs(middle - 0.5)))].path
        raise InputError(f"the estimate of {name} lies outside its prior")
    factor = np.linalg.cholesky(spread)

    def white(u: Floats) -> Floats:
        return np.asarray(np.linalg.solve(factor, (u - middle).T).T)

    found = importance_sample(lambda u: -0.5 * (white(u) ** 2).sum(axis=1), len(free), seed)
    weights = moment_matched_weights(found.weights, white(found.u))
    rows = systematic_resampling(weights, count, np.random.default_rng(seed).random())
    return SoilDraws(tuple(f.path for f in free), low + width * found.u[rows])
