"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.fitting.damped_descents import EXACT, descend
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
    if undeclared and len(readings) <= len(free):
        raise FitError(
            f"{len(readings)} readings cannot determine {len(free)} parameters and their "
            "own noise; declare it in [noise]"
        )
    optimum = fit_under_declared_noise(case, readings, free)
    with_prior = optimum
    if np.any(at_prior_bound(optimum.x)):
        problem = replace(optimum.problem, priors="all")
        with_prior = descend(problem, optimum.x, EXACT, optimum.linearisation)
    x = optimum.x
    found = Misfit.of(optimum)
    excess = not undeclared and found.exceeds_noise
    of_prior = np.asarray([c.fraction_precision for c in free])
    of_tests = optimum.soil_tests.rates(x)
    precision = np.diag(of_prior) + of_tests.T @ of_tests
    noise = found.per_freedom if excess else 1.0
    linearised, along_valley = (
        np.linalg.inv(at.jacobian.T @ at.jacobian / noise + precision)  # Gauss-Newton
        for at in (optimum, with_prior)
    )
    linear_std = np.sqrt(np.diag(linearised))
    uniform = np.where(np.isinf(optimum.problem.normal_std), of_prior, 0.0)
    to_posterior_mean = linearised @ (uniform * (0.5 - x))
    total = np.maximum(
        np.hypot(linear_std, to_posterior_mean),
        np.hypot(np.sqrt(np.diag(along_valley)), with_prior.x - x),
    )
    covariance = linearised * np.outer(total / linear_std, total / linear_std)
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
    return with_warnings(fit, case, readings, free, x, WIDENED if excess else "")
