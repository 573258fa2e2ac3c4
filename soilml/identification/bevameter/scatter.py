"""What tests tell of a quantity: levels, least squares, and scatter from test to test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

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


@dataclass(frozen=True)
class LawDraws:
    """The q coefficients of a law, and draws of them (q, draws): of the mean, of another place."""

    value: Floats
    mean: Floats
    place: Floats

    def estimate(
        self, of: Callable[[Floats], Floats], unit: str, also: Sequence[float] = ()
    ) -> SpreadEstimate:
        """A function of the coefficients (q, ...) with its ranges; both contain `also` too."""
        ends = (np.quantile(of(own), [0.025, 0.975]) for own in (self.mean, self.place))
        first, second = (
            (float(min(low, *also, low)), float(max(high, *also, high))) for low, high in ends
        )
        return SpreadEstimate(float(of(self.value)), first, second, unit)


def distinct_levels(values: Floats) -> tuple[float, ...]:
    """Means of the groups of positive values that are one level but for their scatter."""
    ordered = np.sort(values)
    groups = np.split(ordered, np.flatnonzero(ordered[1:] > SAME_LEVEL * ordered[:-1]) + 1)
    return tuple(float(group.mean()) for group in groups)


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
class TestLine:
    """A line through one value of each of N tests, and the mean of a second quantity of each.

    coefficients: (p,). mean: Of the second quantity.
    error: Draws (draws, p + 1) of the errors of both.
    deviation: Draws (draws, 2) of another test from them: of the logarithm of the value, and of the
        second quantity.
    """

    coefficients: Floats
    mean: float
    error: Floats
    deviation: Floats

    @staticmethod
    def of(
        columns: Floats, value: Floats, second: Floats, usual: Floats, *, above_zero: bool
    ) -> TestLine:
        r"""From columns (N, p) of the line, values (N,), and a second quantity (N,), maybe NaN.

        .. math:: S = \frac{\nu_0 \, \mathrm{diag}(s_0^2) + \sum_i r_i r_i^T}{\nu_0 + \nu}

        is the scatter from test to test, with the residuals r of both and the number nu of tests
        less the p coefficients. Both draws follow Student's t distribution with one common scale.

        usual: Standard deviations s_0, (2,), that repeated tests of such quantities usually have.
        above_zero: Whether a line that meets the axis below zero is drawn again through the origin.

        References: Gelman et al., Bayesian Data Analysis, 2013, section 2.6, scaled inverse
        chi-squared prior.
        """
        (n, p), known = columns.shape, np.isfinite(second)
        line, hat, fitted = relative_line(columns, value)
        if above_zero and p == 2 and line[0] < 0.0:
            slope, _, fitted = relative_line(columns[:, 1:], value)
            line = np.append(0.0, slope)
        mean = float(second[known].mean()) if known.any() else 0.0
        off = np.stack([np.log(value / fitted), np.where(known, second - mean, 0.0)], axis=1)
        freedom = USUAL_FREEDOM + max(n - p, 0)
        scatter = (USUAL_FREEDOM * np.diag(usual**2) + off.T @ off) / freedom
        covariance = np.zeros((p + 1, p + 1))
        covariance[:p, :p] = hat @ hat.T * scatter[0, 0]
        covariance[:p, p] = covariance[p, :p] = hat.sum(axis=1) / n * scatter[0, 1]
        covariance[p, p] = scatter[1, 1] / max(int(known.sum()), 1)
        rng = np.random.default_rng(SEED)
        z = rng.standard_normal((DRAWS, p + 3))
        scale = np.sqrt(freedom / rng.chisquare(freedom, DRAWS))[:, None]
        error = z[:, : p + 1] @ _root(covariance).T * scale
        return TestLine(line, mean, error, z[:, p + 1 :] @ _root(scatter).T * scale)


def _root(covariance: Floats) -> Floats:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
