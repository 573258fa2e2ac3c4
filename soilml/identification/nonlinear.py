"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.fitting.damped_descents import EXACT, descend
from soilml.fitting.least_squares import Solution
from soilml.fitting.misfit import Misfit, fit_under_declared_noise
from soilml.fitting.readings import Readings
from soilml.identification.fit import WIDENED, Fit, at_prior_bound, with_warnings
from soilml.quantities import column


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
    weighted, optimum = fit_under_declared_noise(case, readings, free)
    with_prior = optimum
    if np.any(at_prior_bound(optimum.x)):
        problem = replace(weighted.problem, priors="all")
        with_prior = descend(problem, optimum.x, EXACT, optimum.linearisation)
    return _fit(case, free, readings, optimum, with_prior, undeclared=undeclared)


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
    x = optimum.x
    found = Misfit.of(optimum, readings, len(free))
    excess = not undeclared and found.exceeds_noise
    of_prior = np.asarray([c.fraction_precision for c in free])
    precision = np.diag(of_prior)
    for_tests = optimum.soil_tests.rates(x)
    precision += for_tests.T @ for_tests
    noise_variance = found.per_freedom if excess else 1.0
    covariance, linear_std = _covariance(
        optimum,
        with_prior,
        noise_variance,
        precision,
        np.where(np.isinf(optimum.problem.normal_std), of_prior, 0.0),
    )
    values, rate = values_at(free, x), rates_at(free, x)
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
        misfit=found.per_freedom if excess or found.freedom > 0 else float("nan"),
        channels=tuple(column(name) for name in readings.channels),
    )
    return with_warnings(
        fit,
        case,
        readings,
        free,
        x,
        excess_residuals=WIDENED if excess else "",
        undeclared=undeclared,
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
