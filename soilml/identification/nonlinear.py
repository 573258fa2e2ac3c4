"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.channel_predictions import stacked_readings
from soilml.fitting.declared_discrepancy import discrepancy_columns, stacked_columns
from soilml.fitting.descent import LeastSquaresProblem, Optimum, descend, global_optimum
from soilml.fitting.free_parameters import FreeParameter, values_at
from soilml.fitting.observations import Observations
from soilml.fitting.shared_errors_modelled import errors_at, with_modelled_errors
from soilml.fitting.shared_errors_sensor_columns import sensor_columns
from soilml.identification.diagnostics import at_prior_bound, with_warnings
from soilml.identification.fit_result import Fit
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Rounds in which the fit is repeated with noise estimated from its residuals, and with errors of
#: sensors in proportion to its predictions.
NOISE_ROUNDS = 3
#: Undeclared noise before any residual is known, as a fraction of the channel's RMS reading.
INITIAL_NOISE = 0.05
#: Sum of squared residuals that is significant where no degree of freedom is left: 3 sigma.
SIGNIFICANT_COST = 9.0


def nonlinear(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
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
    data
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
    undeclared = any(not c.declared for c in data.channels)
    if undeclared and data.reading_count <= len(free):
        raise FitError(
            f"{data.reading_count} readings cannot determine {len(free)} parameters and their own "
            "noise; declare it in [noise]"
        )
    problem = least_squares_problem(case, data, free)
    optimum = global_optimum(problem)
    for _ in range(NOISE_ROUNDS if undeclared or data.shared_errors else 1):
        problem = problem.with_noise_at(optimum)
        optimum = descend(problem, optimum.u, near=optimum.about)
    with_prior = optimum
    if np.any(at_prior_bound(optimum.u[: len(free)])):
        with_prior = descend(problem, optimum.u, with_prior=True, near=optimum.about)
    return _fit(case, free, problem, optimum, with_prior, undeclared=undeclared)


def least_squares_problem(
    case: Case, data: Observations, free: Sequence[FreeParameter]
) -> LeastSquaresProblem:
    """The problem with noise as declared, and errors that all rows share as parameters."""
    reading, declared = stacked_readings(data)
    case, unknown = with_modelled_errors(case, data, free)
    shared = sensor_columns(data, reading[None, :])
    return LeastSquaresProblem(
        case=case,
        data=data,
        free=unknown,
        errors=len(unknown) - len(free),
        reading=reading,
        std=np.where(np.isfinite(declared), declared, _initial_noise(data)),
        columns=stacked_columns(discrepancy_columns(case, data)),
        shared=np.zeros((reading.size, 0)) if shared is None else shared[0],
    )


def _fit(
    case: Case,
    free: Sequence[FreeParameter],
    problem: LeastSquaresProblem,
    optimum: Optimum,
    with_prior: Optimum,
    *,
    undeclared: bool,
) -> Fit:
    """The result at an optimum; `with_prior` is the one that a Gaussian prior is included in."""
    data = problem.data
    p, k = len(free), data.reading_count
    freedom, squares = k - p, optimum.cost + data.squares_within
    if problem.errors:
        squares += float(np.sum(errors_at(problem.free, optimum.u[None, :]) ** 2))
    misfit = squares / freedom if freedom > 0 else float("nan")
    per_reading = misfit if freedom > 0 else squares / k
    # mean plus two standard deviations of chi-squared over its degrees of freedom
    limit = 1.0 + 2.0 * np.sqrt(2.0 / freedom) if freedom > 0 else SIGNIFICANT_COST / k
    excess = bool(not undeclared and per_reading > limit)
    precision = np.diag(problem.prior_precision)
    for_tests = problem.of_soil_tests(optimum.u)[1]
    precision += for_tests.T @ for_tests
    noise_variance = per_reading if excess else 1.0
    covariance, linear_std = _covariance(
        optimum,
        with_prior,
        noise_variance,
        precision,
        np.where(np.isinf(problem.normal_std), problem.prior_precision, 0.0),
    )
    covariance = covariance[:p, :p]
    values, rate = values_at(free, optimum.u[:p])
    fit = Fit(
        method="nonlinear",
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=values,
        covariance=covariance * np.outer(rate, rate),
        warnings=(),
        rows_used=data.row_count,
        remaining_fraction={
            f.path: float(np.sqrt(f.prior.fraction_precision) * linear_std[i])
            for i, f in enumerate(free)
        },
        misfit=per_reading if excess else misfit,
        channels=tuple(column(c.name) for c in data.channels),
    )
    return with_warnings(
        fit,
        case,
        data,
        free,
        optimum.u[:p],
        excess_residuals=excess,
        undeclared=undeclared,
    )


def _covariance(
    optimum: Optimum,
    with_prior: Optimum,
    noise_variance: float,
    precision: Floats,
    uniform_precision: Floats,
) -> tuple[Floats, Floats]:
    """Covariance (p, p) of the error of `optimum.u`, and the std (p,) of the linearised problem."""
    linearised = _posterior_covariance(optimum, noise_variance, precision)
    std = np.sqrt(np.diag(linearised))
    to_posterior_mean = linearised @ (uniform_precision * (0.5 - optimum.u))
    along_valley = np.sqrt(np.diag(_posterior_covariance(with_prior, noise_variance, precision)))
    total = np.maximum(
        np.hypot(std, to_posterior_mean), np.hypot(along_valley, with_prior.u - optimum.u)
    )
    return linearised * np.outer(total / std, total / std), std


def _posterior_covariance(at: Optimum, noise_variance: float, precision: Floats) -> Floats:
    """Inverse of the Gauss-Newton Hessian, with the precision (p, p) of priors and soil tests."""
    information = at.jacobian.T @ at.jacobian / noise_variance
    return np.asarray(np.linalg.inv(information + precision))


def _initial_noise(data: Observations) -> Floats:
    """A fraction of each channel's RMS reading, (k,)."""
    parts = []
    for channel in data.channels:
        reading = channel.reading[np.isfinite(channel.reading)]
        rms = float(np.sqrt(np.mean(reading**2)))
        parts.append(np.full(reading.size, INITIAL_NOISE * rms + 1e-12))
    return np.concatenate(parts)
