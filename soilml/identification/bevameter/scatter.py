"""Scatter from test to test, and what it leaves open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Draws by which uncertainties are carried from test results to soil parameters: quantiles of 2.5
#: and 97.5 % are then known to 2 % of the standard deviation.
DRAWS = 20000
#: Degrees of freedom of the scatter that is usual: it counts as two repeats would, so that
#: one test alone is no certainty and six repeats decide for themselves.
USUAL_FREEDOM = 2.0
#: Seed of the draws: the same tables give the same file.
SEED = 0


@dataclass(frozen=True)
class Scatter:
    """Covariance (q, q) from test to test of q quantities, with its degrees of freedom."""

    covariance: Floats
    degrees_of_freedom: float

    def draws(self, mean_covariance: Floats) -> tuple[Floats, Floats]:
        """Errors of the mean, (draws, p), and deviations of another test from it, (draws, q).

        `mean_covariance` (p, p) is that of the estimated means for a scatter as estimated; both
        follow Student's t distribution with one common unknown scale.
        """
        rng = np.random.default_rng(SEED)
        p, q = len(mean_covariance), len(self.covariance)
        z = rng.standard_normal((DRAWS, p + q))
        freedom = self.degrees_of_freedom
        scale = np.sqrt(freedom / rng.chisquare(freedom, DRAWS))[:, None]
        mean = z[:, :p] @ _root(mean_covariance).T * scale
        return mean, z[:, p:] @ _root(self.covariance).T * scale


def pooled_scatter(residuals: Floats, usual: Floats, estimated: int) -> Scatter:
    r"""Scatter from residuals of tests, (tests, q), and from what is usual.

    .. math:: S = \frac{\nu_0 \, \mathrm{diag}(s_0^2) + \sum_i r_i r_i^T}{\nu_0 + \nu}

    Parameters
    ----------
    usual
        Standard deviations s_0, (q,), that repeated tests of such a quantity usually have.
    estimated
        Number of means that were fitted to the tests; nu is the number of tests less this.

    References
    ----------
    Gelman et al., Bayesian Data Analysis, 2013, section 2.6, scaled inverse chi-squared prior.
    """
    freedom = max(len(residuals) - estimated, 0)
    total = USUAL_FREEDOM * np.diag(usual**2) + residuals.T @ residuals
    return Scatter(total / (USUAL_FREEDOM + freedom), USUAL_FREEDOM + freedom)


def _root(covariance: Floats) -> Floats:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
