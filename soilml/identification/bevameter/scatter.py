"""What tests tell of a quantity: levels, least squares, and scatter from test to test."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats

#: Draws by which uncertainties are carried from test results to soil parameters: quantiles of 2.5
#: and 97.5 % are then known to 2 % of the standard deviation.
DRAWS = 20000
#: Degrees of freedom of the scatter that is usual: it counts as two repeats would, so that
#: one test alone is no certainty and six repeats decide for themselves.
USUAL_FREEDOM = 2.0
SEED = 0  # Seed of the draws: the same tables give the same file
SAME_LEVEL = 1.03  # Sizes or loads that differ by less than this factor are meant to be the same
ROUNDS = 4  # Rounds in which the weights follow the fit; they settle in two or three
#: Least fitted value, as a fraction of the measured one, that is used for a weight.
LEAST_FITTED = 1e-3


@dataclass(frozen=True)
class SpreadEstimate:
    """A value with two ranges of 95 %."""

    value: float  # The estimate, in `unit`
    mean_95: tuple[float, float]  # Where the mean of many such tests would lie
    # Where the value at another place of the same soil would lie; it contains the scatter from test
    # to test, and is what a prior for other runs should be
    another_place_95: tuple[float, float]
    unit: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in a JSON file."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}


def spread_estimate(value: float, mean: Floats, place: Floats, unit: str) -> SpreadEstimate:
    """The estimate with the ranges of draws of the mean and of another place, (draws,) each."""
    low, high = np.quantile(mean, [0.025, 0.975])
    first, last = np.quantile(place, [0.025, 0.975])
    return SpreadEstimate(value, (float(low), float(high)), (float(first), float(last)), unit)


def distinct_levels(values: Floats) -> tuple[float, ...]:
    """Means of the groups of positive values that are one level but for their scatter."""
    ordered = np.sort(values)
    groups = np.split(ordered, np.flatnonzero(ordered[1:] > SAME_LEVEL * ordered[:-1]) + 1)
    return tuple(float(group.mean()) for group in groups)


def is_level(values: Floats, level: float) -> NDArray[np.bool_]:
    """Which values belong to a level, (k,)."""
    return np.asarray(np.maximum(values / level, level / values) < SAME_LEVEL)


def relative_line(columns: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients (p,) of columns (N, p), their derivatives (p, N), and the fitted values (N,).

    The residuals are those of y (N,), which is positive, relative to the fit; the derivatives are
    those by the relative errors of y.
    """
    fitted = y.copy()
    for _ in range(ROUNDS):
        scaled = columns / fitted[:, None]
        hat = np.asarray(np.linalg.pinv(scaled))
        line = np.asarray(hat @ (y / fitted))
        fitted = np.maximum(columns @ line, LEAST_FITTED * y)
    return line, hat, fitted


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

    usual: Standard deviations s_0, (q,), that repeated tests of such a quantity usually have.
    estimated: Number of means that were fitted to the tests; nu is the number of tests less this.

    References: Gelman et al., Bayesian Data Analysis, 2013, section 2.6, scaled inverse chi-squared
    prior.
    """
    freedom = max(len(residuals) - estimated, 0)
    total = USUAL_FREEDOM * np.diag(usual**2) + residuals.T @ residuals
    return Scatter(total / (USUAL_FREEDOM + freedom), USUAL_FREEDOM + freedom)


def _root(covariance: Floats) -> Floats:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
