"""Fits under the declared noise, and the test of their misfit that all commands share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import Whitening, discrepancy_process, noise_of_operation
from soilml.fitting.damped_descents import EXACT, FINE, descend
from soilml.fitting.error_columns import error_columns, stacked
from soilml.fitting.global_optimum import global_optimum
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.readings import Readings
from soilml.numerics.quantiles import chi_squared_quantile
from soilml.numerics.smooth_process import LEAST_EIGENVALUE
from soilml.remarks import Remark

#: Rounds in which the fit is repeated with noise estimated from its residuals, and with errors of
#: sensors in proportion to its predictions.
NOISE_ROUNDS = 3
#: Undeclared noise before any residual is known, as a fraction of the channel's RMS reading.
INITIAL_NOISE = 0.05


def problem_under_noise(
    case: Case, readings: Readings, free: Sequence[Coordinate], optimum: Solution | None = None
) -> LeastSquaresProblem:
    """The problem of readings weighted by their noise, the model discrepancy and shared errors.

    optimum: Where noise and shared errors are; noise that is not declared is then that of its
        residuals. By default noise is as declared, and the soil that of the case.
    """
    if optimum is None:
        square = _mean_by_channel(readings, readings.measured**2)
        soil, weighted, otherwise = case, readings, INITIAL_NOISE * np.sqrt(square) + 1e-12
    else:
        soil, weighted = optimum.fitted(), readings.with_noise_at(optimum.prediction)
        weighted = weighted.with_noise_of_operation(noise_of_operation(soil, readings))
        # noise of each channel from its residuals, the parameters shared among all readings
        square = optimum.problem.residual(optimum.prediction) ** 2
        size = np.bincount(readings.channel)[readings.channel]
        freedom = np.maximum(size * (1.0 - len(free) / len(readings)), 1.0)
        scatter = np.sqrt(_mean_by_channel(readings, square) * size / freedom)
        least = 1e-6 * np.sqrt(_mean_by_channel(readings, readings.measured**2)) + 1e-15
        otherwise = np.maximum(scatter, least)
    std = np.where(np.isfinite(weighted.std), weighted.std, otherwise)
    whiten = Whitening.beside(1.0 / std, columns_of_errors(soil, readings))
    return LeastSquaresProblem(case, free, replace(weighted, std=std), whiten, "normal")


def columns_of_errors(case: Case, readings: Readings) -> Floats:
    """Columns (m, q) of the model discrepancy of a case, and of errors that all rows share."""
    own = case.discrepancy, Discrepancy(), LEAST_EIGENVALUE, case.remainder
    columns = discrepancy_process(readings, *own).columns
    if not readings.shared_errors:
        return columns
    shared = stacked(error_columns(case, readings, readings.shared_errors), len(readings))
    return np.hstack([columns, shared])


def _mean_by_channel(readings: Readings, values: Floats) -> Floats:
    """Mean of values (m,) over the channel of each reading, (m,)."""
    counts = np.maximum(np.bincount(readings.channel), 1)
    return np.asarray((np.bincount(readings.channel, values) / counts)[readings.channel])


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
    def of(optimum: Solution) -> Misfit:
        """That of an optimum."""
        count = len(optimum.problem.readings)
        return Misfit(optimum.cost, count - len(optimum.x), count)

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


@lru_cache(maxsize=64)
def misfit_limit(freedom: int) -> float:
    """Misfit per degree of freedom that noise alone exceeds with a probability of 0.001.

    The 0.999 quantile of chi-squared over its degrees of freedom; infinite without any.
    """
    return chi_squared_quantile(freedom, Z_999) / freedom if freedom >= 1 else np.inf


def fit_under_declared_noise(
    case: Case, readings: Readings, free: Sequence[Coordinate], start: Floats | None = None
) -> Solution:
    """The best fit of p parameters under the declared noise; its problem has the weighted readings.

    start (p,): Where it starts, as fractions of the priors; by default the lowest of several
        optima is found.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    problem = problem_under_noise(case, readings, free)
    optimum = global_optimum(problem) if start is None else descend(problem, start, FINE)
    for _ in range(NOISE_ROUNDS if readings.undeclared or readings.shared_errors else 1):
        problem = problem_under_noise(case, readings, free, optimum)
        optimum = descend(problem, optimum.x, EXACT, optimum.linearisation)
    return optimum


def declared_misfit(
    case: Case, readings: Readings, free: Sequence[Coordinate], start: Floats | None = None
) -> Misfit | None:
    """The misfit of rows of declared noise; None where it is not declared or no fit is possible."""
    if readings.undeclared or not len(readings):
        return None
    try:
        optimum = fit_under_declared_noise(case, readings, free, start)
    except FitError:
        return None
    return Misfit.of(optimum)


def excess_residuals_remark(factor: float, case: Case, consequence: str) -> Remark:
    """That residuals are `factor` times the declared noise, and what follows."""
    text = (
        f"residuals are {factor:.1f} times the declared noise"
        f"{' and discrepancy' if case.discrepancy else ''}: the model lacks an effect, the soil "
        f"changed between rows, or the noise is understated; {consequence}"
    )
    return Remark("excess-residuals", text)
