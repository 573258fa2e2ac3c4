"""The test of misfit that all commands share: residuals of the best soil under declared noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import Solution
from soilml.fitting.readings import Readings
from soilml.fitting.scipy_descents import descend, global_optimum
from soilml.fitting.shared_errors import errors_at
from soilml.fitting.weighted_rows import NOISE_ROUNDS, WeightedRows
from soilml.numerics.quantiles import chi_squared_quantile
from soilml.remarks import Remark

Z_999 = 3.09  # Normal quantile of 0.999
#: Sum of squared residuals that is significant where no degree of freedom is left: 3 sigma.
SIGNIFICANT_COST = 9.0


@dataclass(frozen=True)
class Misfit:
    """Squared residuals of a fit in variances of the declared noise.

    With a model discrepancy, or errors that all rows share, weighted by the inverse covariance;
    `squares` then includes those of these errors.
    """

    squares: float
    freedom: int  # readings less parameters
    readings: int

    @staticmethod
    def of(optimum: Solution, readings: Readings, parameters: int) -> Misfit:
        """That of an optimum, of which the first coordinates are the parameters."""
        squares = optimum.cost + readings.squares_within
        if len(optimum.coordinates) > parameters:
            squares += float(np.sum(errors_at(optimum.coordinates, optimum.x[None, :]) ** 2))
        count = readings.reading_count
        return Misfit(float(squares), count - parameters, count)

    @property
    def per_freedom(self) -> float:
        """Mean squared residual per degree of freedom; per reading where none is left."""
        return self.squares / (self.freedom if self.freedom > 0 else self.readings)

    @property
    def factor(self) -> float:
        """Size of the residuals in standard deviations of the declared noise."""
        return float(np.sqrt(self.per_freedom))

    @property
    def exceeds_noise(self) -> bool:
        """Whether noise alone would exceed these residuals with a probability below 0.001."""
        if self.freedom < 1:
            return self.squares > SIGNIFICANT_COST
        return self.per_freedom > misfit_limit(self.freedom)


def misfit_limit(freedom: int) -> float:
    """Misfit per degree of freedom that noise alone exceeds with a probability of 0.001.

    The 0.999 quantile of chi-squared over its degrees of freedom; infinite without any.
    """
    return chi_squared_quantile(freedom, Z_999) / freedom if freedom >= 1 else np.inf


def fit_under_declared_noise(
    case: Case, readings: Readings, free: Sequence[Coordinate], start: Floats | None = None
) -> tuple[WeightedRows, Solution]:
    """The best fit of p parameters under the declared noise, and the rows as it weights them.

    start (p,): Where it starts, as fractions of the priors; by default the lowest of several
        optima is found.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    weighted = WeightedRows.of(case, readings, free)
    if start is None or len(weighted.unknown) > len(free):
        optimum = global_optimum(weighted.problem, weighted.of_few_rows().problem)
    else:
        optimum = descend(weighted.problem, start)
    for _ in range(NOISE_ROUNDS if readings.undeclared or readings.shared_errors else 1):
        weighted = weighted.with_noise_at(optimum)
        optimum = descend(weighted.problem, optimum.x, near=optimum.linearisation)
    return weighted, optimum


def declared_misfit(
    case: Case, readings: Readings, free: Sequence[Coordinate], start: Floats | None = None
) -> Misfit | None:
    """The misfit of rows of declared noise; None where it is not declared or no fit is possible."""
    if readings.undeclared or not readings.reading_count:
        return None
    try:
        _, optimum = fit_under_declared_noise(case, readings, free, start)
    except FitError:
        return None
    return Misfit.of(optimum, readings, len(free))


def excess_residuals(factor: float, with_discrepancy: bool) -> str:
    """How many times the declared noise the residuals are, in words."""
    discrepancy = " and discrepancy" if with_discrepancy else ""
    return f"residuals are {factor:.1f} times the declared noise{discrepancy}"


def excess_residuals_remark(factor: float, case: Case, consequence: str) -> Remark:
    """That residuals are `factor` times the declared noise, and what follows."""
    found = excess_residuals(factor, bool(case.discrepancy))
    text = (
        f"{found}: the model lacks an effect, the soil changed between "
        f"rows, or the noise is understated; {consequence}"
    )
    return Remark("excess-residuals", text)
