"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.fitting.covariance import (
    Whitening,
    discrepancy_process,
    noise_of_operation,
    sensor_columns,
)
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.readings import Readings
from soilml.fitting.scipy_descents import descend, global_optimum
from soilml.fitting.shared_errors import errors_at, with_modelled_errors
from soilml.identification.fit import Fit, at_prior_bound, with_warnings
from soilml.numerics.smooth_process import LEAST_EIGENVALUE
from soilml.quantities import column

#: Rounds in which the fit is repeated with noise estimated from its residuals, and with errors of
#: sensors in proportion to its predictions.
NOISE_ROUNDS = 3
#: Undeclared noise before any residual is known, as a fraction of the channel's RMS reading.
INITIAL_NOISE = 0.05
#: Sum of squared residuals that is significant where no degree of freedom is left: 3 sigma.
SIGNIFICANT_COST = 9.0
FEW = 16  # Readings of each channel of the few rows that tell good starts from bad ones


def nonlinear(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Weighted least squares within the bounds of the priors, from several starts.

    .. math:: \min_\theta \sum_i \left(\frac{y_i - f(s_i, W_i; \theta)}{\sigma_i}\right)^2

    Noise of slip and load is propagated into sigma (effective variance). Relative noise is taken
    relative to the prediction: relative to the reading it would bias the fit low, by about twice
    its square, since readings with negative errors would have the larger weights. With a model
    discrepancy, or errors that all rows share, residuals are weighted by the inverse covariance of
    noise, discrepancy and these errors. Errors that the model is solved with (of slip, load,
    bearing and contact) are estimated with the soil, and left out of the result.

    Normal priors and tests of the soil take part in the sum. The covariance is that of the
    linearised problem with a Gaussian prior of the uniform one's variance, enlarged by the squared
    distance between the optimum and the posterior mean: `std` stays realistic for a parameter that
    the rows do not determine. Where the optimum lies at a bound, equally good values lie along a
    valley that bends away from it. Covariance and distance are then also computed at the optimum
    with the Gaussian prior included, and the larger std is used.

    Parameters
    ----------
    case
        Model, soil, priors and noise.
    readings
        Rows with k readings.
    free
        The p free parameters.

    Returns
    -------
    Fit
        With the remaining fraction of each prior.

    Raises
    ------
    FitError
        Where noise is undeclared and there are no more readings than parameters, or where the model
        has no equilibrium at the measured loads for any parameters in the prior.

    References
    ----------
    Bard, Nonlinear Parameter Estimation, 1974. Orear, Am. J. Phys. 50(10), 1982 (effective
    variance).
    """
    undeclared = bool(readings.undeclared)
    if undeclared and readings.reading_count <= len(free):
        raise FitError(
            f"{readings.reading_count} readings cannot determine {len(free)} parameters and their "
            "own noise; declare it in [noise]"
        )
    weighted = WeightedRows.of(case, readings, free)
    optimum = global_optimum(weighted.problem, weighted.of_few_rows().problem)
    for _ in range(NOISE_ROUNDS if undeclared or readings.shared_errors else 1):
        weighted = weighted.with_noise_at(optimum)
        optimum = descend(weighted.problem, optimum.x, near=optimum.linearisation)
    with_prior = optimum
    if np.any(at_prior_bound(optimum.x[: len(free)])):
        with_prior = descend(
            weighted.problem, optimum.x, with_prior=True, near=optimum.linearisation
        )
    return _fit(case, free, readings, optimum, with_prior, undeclared=undeclared)


@dataclass(frozen=True)
class WeightedRows:
    """Readings whose noise depends on what is expected of them, and the case that is fitted."""

    case: Case  # With the errors that the model is solved with, where there are any
    readings: Readings  # With the standard deviations (m,) that the fit gives them
    declared: Readings  # The readings as they were declared
    unknown: Sequence[Coordinate]  # The p free parameters, and behind them these errors
    # Columns (m, e) of errors that all rows share and that act on the readings alone
    shared: Floats

    @staticmethod
    def of(case: Case, readings: Readings, free: Sequence[Coordinate]) -> WeightedRows:
        """With noise as declared, and errors that all rows share as parameters."""
        changed, unknown = with_modelled_errors(
            case, readings.shared_errors, readings.row_load, free
        )
        std = np.where(np.isfinite(readings.std), readings.std, _initial_noise(readings))
        shared = sensor_columns(readings, readings.measured[None, :])
        return WeightedRows(
            case=changed,
            readings=replace(readings, std=std),
            declared=readings,
            unknown=unknown,
            shared=np.zeros((len(readings), 0)) if shared is None else shared[0],
        )

    @cached_property
    def problem(self) -> LeastSquaresProblem:
        """The problem, weighted by noise, model discrepancy and shared errors."""
        process = discrepancy_process(
            self.readings, self.case.discrepancy, Discrepancy(), LEAST_EIGENVALUE
        )
        columns = np.hstack([process.columns, self.shared])
        whiten = Whitening.of(self.readings.std, columns)
        return LeastSquaresProblem(self.case, self.unknown, self.readings, whiten)

    def of_few_rows(self) -> WeightedRows:
        """A few of the rows, from the lightest to the heaviest of each channel."""
        selected, few = self.readings.of_rows(_few_rows(self.readings))
        return replace(self, readings=few, shared=self.shared[selected])

    def with_noise_at(self, optimum: Solution) -> WeightedRows:
        """The same with noise at the optimum's predictions, or from its residuals.

        Errors of sensors that all rows share are in proportion to the same predictions.
        """
        prediction, readings = optimum.prediction, self.declared
        total = np.hypot(
            readings.noise_at(prediction),
            noise_of_operation(self.case, readings, self.unknown, optimum.x),
        )
        free = sum(c.normal_std is None for c in self.unknown)
        estimated = _residual_noise(readings, optimum.problem.residual(prediction), free)
        shared = sensor_columns(readings, prediction[None, :])
        return replace(
            self,
            readings=replace(readings, std=np.where(np.isfinite(total), total, estimated)),
            shared=self.shared if shared is None else shared[0],
        )


def _fit(
    case: Case,
    free: Sequence[Coordinate],
    readings: Readings,
    optimum: Solution,
    with_prior: Solution,
    *,
    undeclared: bool,
) -> Fit:
    """The result at an optimum; `with_prior` is the one that a Gaussian prior is included in."""
    unknown, x = optimum.coordinates, optimum.x
    p, k = len(free), readings.reading_count
    freedom, squares = k - p, optimum.cost + readings.squares_within
    if len(unknown) > p:
        squares += float(np.sum(errors_at(unknown, x[None, :]) ** 2))
    misfit = squares / freedom if freedom > 0 else float("nan")
    per_reading = misfit if freedom > 0 else squares / k
    # mean plus two standard deviations of chi-squared over its degrees of freedom
    limit = 1.0 + 2.0 * np.sqrt(2.0 / freedom) if freedom > 0 else SIGNIFICANT_COST / k
    excess = bool(not undeclared and per_reading > limit)
    of_prior = np.asarray([c.fraction_precision for c in unknown])
    precision = np.diag(of_prior)
    for_tests = optimum.soil_tests.rates(x)
    precision += for_tests.T @ for_tests
    noise_variance = per_reading if excess else 1.0
    covariance, linear_std = _covariance(
        optimum,
        with_prior,
        noise_variance,
        precision,
        np.where(np.isinf(optimum.problem.normal_std), of_prior, 0.0),
    )
    covariance = covariance[:p, :p]
    values, rate = values_at(free, x[:p]), rates_at(free, x[:p])
    fit = Fit(
        method="nonlinear",
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=values,
        covariance=covariance * np.outer(rate, rate),
        warnings=(),
        rows_used=readings.row_count,
        remaining_fraction={
            f.path: float(np.sqrt(f.prior.fraction_precision) * linear_std[i])
            for i, f in enumerate(free)
        },
        misfit=per_reading if excess else misfit,
        channels=tuple(column(name) for name in readings.channels),
    )
    return with_warnings(
        fit, case, readings, free, x[:p], excess_residuals=excess, undeclared=undeclared
    )


def _covariance(
    optimum: Solution,
    with_prior: Solution,
    noise_variance: float,
    precision: Floats,
    uniform_precision: Floats,
) -> tuple[Floats, Floats]:
    """Covariance (p, p) of the error of `optimum.x`, and the std (p,) of the linearised problem."""
    linearised = _posterior_covariance(optimum, noise_variance, precision)
    std = np.sqrt(np.diag(linearised))
    to_posterior_mean = linearised @ (uniform_precision * (0.5 - optimum.x))
    along_valley = np.sqrt(np.diag(_posterior_covariance(with_prior, noise_variance, precision)))
    total = np.maximum(
        np.hypot(std, to_posterior_mean), np.hypot(along_valley, with_prior.x - optimum.x)
    )
    return linearised * np.outer(total / std, total / std), std


def _posterior_covariance(at: Solution, noise_variance: float, precision: Floats) -> Floats:
    """Inverse of the Gauss-Newton Hessian, with the precision (p, p) of priors and soil tests."""
    information = at.jacobian.T @ at.jacobian / noise_variance
    return np.asarray(np.linalg.inv(information + precision))


def _few_rows(readings: Readings) -> NDArray[np.int64]:
    """Rows that stand for all: from the lightest to the heaviest with a reading of each channel."""
    rows = []
    for i in range(len(readings.channels)):
        measured = readings.row[readings.channel == i]
        slip, load = readings.row_slip[measured], readings.row_load[measured]
        in_order = measured[np.lexsort((slip, load))]
        few = np.linspace(0, len(in_order) - 1, min(FEW, len(in_order)))
        rows.append(in_order[few.round().astype(int)])
    return np.unique(np.concatenate(rows))


def _initial_noise(readings: Readings) -> Floats:
    """A fraction of each channel's RMS reading, (m,)."""
    return _by_channel(readings, lambda own: INITIAL_NOISE * _rms(readings.measured[own]) + 1e-12)


def _residual_noise(readings: Readings, residual: Floats, p: int) -> Floats:
    """Noise of each channel (m,) from its residuals, p parameters shared among all readings."""

    def noise(own: NDArray[np.bool_]) -> float:
        size = int(own.sum())
        freedom = max(size - p * size / len(readings), 1.0)
        scatter = float(np.sqrt(residual[own] @ residual[own] / freedom))
        return max(scatter, 1e-6 * _rms(readings.measured[own]) + 1e-15)

    return _by_channel(readings, noise)


def _by_channel(readings: Readings, noise: Callable[[NDArray[np.bool_]], float]) -> Floats:
    std = np.empty(len(readings))
    for i in range(len(readings.channels)):
        own = readings.channel == i
        std[own] = noise(own)
    return std


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
