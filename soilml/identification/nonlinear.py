"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError, MissingLibraryError
from soilml.identification.data.observations import Observations
from soilml.identification.diagnostics import at_prior_bound, with_warnings
from soilml.identification.discrepancy import discrepancy_columns, stacked_columns
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import FreeParameter, values_at
from soilml.identification.predictions import (
    linearise,
    noise_at_prediction,
    predict_channels,
    propagated_input_noise,
    stack_channels,
    stacked_readings,
)
from soilml.numerics.noise_and_process import Whitener
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Sobol points of the prior that are evaluated, and how many of the best are descended from.
SOBOL_POINTS = 64
STARTS = 4
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02
#: Rounds in which undeclared noise is estimated from residuals and the fit repeated.
NOISE_ROUNDS = 3
#: Undeclared noise before any residual is known, as a fraction of the channel's RMS reading.
INITIAL_NOISE = 0.05
#: Sum of squared residuals that is significant where no degree of freedom is left: 3 sigma.
SIGNIFICANT_COST = 9.0
#: Precision of a uniform distribution over the unit interval: 1 / its variance.
UNIFORM_PRECISION = 12.0
#: Residual, in standard deviations, of a row that has no equilibrium at a trial.
NO_EQUILIBRIUM = 1e3


@dataclass(frozen=True)
class _Optimum:
    u: Floats  # (p,) fractions of the priors
    residual: Floats  # (k,) of unit covariance
    jacobian: Floats  # (k, p)

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class _Problem:
    case: Case
    data: Observations
    free: Sequence[FreeParameter]
    reading: Floats  # (k,)
    std: Floats  # (k,)
    columns: Floats  # (k, q) of the model discrepancy

    @cached_property
    def whitener(self) -> Whitener:
        """Inverse root of the covariance of noise and discrepancy."""
        return Whitener.of(self.std, self.columns)

    def predict(self, u: Floats) -> Floats:
        """Predictions (sets, k) at u (sets, p)."""
        return stack_channels(self.data, predict_channels(self.case, self.free, u, self.data.at))

    def whitened(self, prediction: Floats) -> Floats:
        """Residuals of unit covariance: in standard deviations, where there is no discrepancy."""
        return self.whitener(self.residual(prediction))

    def residual(self, prediction: Floats) -> Floats:
        """Residuals in the units of the readings."""
        residual = prediction - self.reading
        return np.where(np.isnan(residual), NO_EQUILIBRIUM * self.std, residual)

    def linearised(self, u: Floats) -> tuple[Floats, Floats]:
        """Whitened residuals (k,) and Jacobian (k, p)."""
        prediction, jacobian = linearise(self.case, self.data, self.free, u)
        return self.whitened(prediction), self.whitener(np.nan_to_num(jacobian).T).T

    def with_noise_at(self, optimum: _Optimum) -> _Problem:
        """The same problem, noise taken at the optimum's predictions or from its residuals."""
        case, data, free = self.case, self.data, self.free
        prediction = self.predict(optimum.u[None, :])
        declared = noise_at_prediction(case, data, prediction)[0]
        slip_std, load_std = data.slip_std, data.load_std
        from_inputs = propagated_input_noise(case, free, optimum.u, data.at, slip_std, load_std)
        total = np.hypot(declared, stack_channels(data, from_inputs)[0])
        estimated = _residual_noise(data, self.reading, self.residual(prediction)[0], len(free))
        return replace(self, std=np.where(np.isfinite(total), total, estimated))


def nonlinear(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    r"""Weighted least squares within the bounds of the priors, from several starts.

    .. math:: \min_\theta \sum_i \left(\frac{y_i - f(s_i, W_i; \theta)}{\sigma_i}\right)^2

    Noise of slip and load is propagated into sigma (effective variance). Relative noise is taken
    relative to the prediction: relative to the reading it would bias the fit low, by about twice
    its square, since readings with negative errors would have the larger weights. With a model
    discrepancy, residuals are weighted by the inverse covariance of noise and discrepancy.

    The covariance is that of the linearised problem with a Gaussian prior of the uniform one's
    variance, enlarged by the squared distance between the optimum and the posterior mean: `std`
    stays realistic for a parameter that the rows do not determine. Where the optimum lies at a
    bound, equally good values lie along a valley that bends away from it. Covariance and distance
    are then also computed at the optimum with the Gaussian prior included, and the larger std is
    used.

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
    reading, declared = stacked_readings(data)
    std = np.where(np.isfinite(declared), declared, _initial_noise(data))
    columns = stacked_columns(discrepancy_columns(case, data))
    problem = _Problem(case, data, free, reading, std, columns)
    optimum = _global_optimum(problem)
    for _ in range(NOISE_ROUNDS if undeclared else 1):
        problem = problem.with_noise_at(optimum)
        optimum = _descend(problem, optimum.u)
    with_prior = optimum
    if np.any(at_prior_bound(optimum.u)):
        with_prior = _descend(problem, optimum.u, UNIFORM_PRECISION)
    return _fit(problem, optimum, with_prior, undeclared=undeclared)


def _fit(problem: _Problem, optimum: _Optimum, with_prior: _Optimum, *, undeclared: bool) -> Fit:
    """The result at an optimum; `with_prior` is the one that a Gaussian prior is included in."""
    data, free = problem.data, problem.free
    p, k = len(free), len(optimum.residual)
    freedom = k - p
    misfit = optimum.cost / freedom if freedom > 0 else float("nan")
    per_reading = misfit if freedom > 0 else optimum.cost / k
    # mean plus two standard deviations of chi-squared over its degrees of freedom
    limit = 1.0 + 2.0 * np.sqrt(2.0 / freedom) if freedom > 0 else SIGNIFICANT_COST / k
    excess = bool(not undeclared and per_reading > limit)
    covariance, linear_std = _covariance(optimum, with_prior, per_reading if excess else 1.0)
    values, rate = values_at(free, optimum.u)
    fit = Fit(
        method="nonlinear",
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=values,
        covariance=covariance * np.outer(rate, rate),
        warnings=(),
        rows_used=len(data.slip),
        remaining_fraction={
            f.path: float(np.sqrt(UNIFORM_PRECISION) * linear_std[i]) for i, f in enumerate(free)
        },
        misfit=per_reading if excess else misfit,
        channels=tuple(column(c.name) for c in data.channels),
    )
    return with_warnings(
        fit,
        problem.case,
        data,
        free,
        optimum.u,
        excess_residuals=excess,
        undeclared=undeclared,
    )


def _covariance(
    optimum: _Optimum, with_prior: _Optimum, noise_variance: float
) -> tuple[Floats, Floats]:
    """Covariance (p, p) of the error of `optimum.u`, and the std (p,) of the linearised problem."""
    linearised = _posterior_covariance(optimum, noise_variance)
    std = np.sqrt(np.diag(linearised))
    to_posterior_mean = linearised @ (UNIFORM_PRECISION * (0.5 - optimum.u))
    along_valley = np.sqrt(np.diag(_posterior_covariance(with_prior, noise_variance)))
    total = np.maximum(
        np.hypot(std, to_posterior_mean), np.hypot(along_valley, with_prior.u - optimum.u)
    )
    return linearised * np.outer(total / std, total / std), std


def _posterior_covariance(at: _Optimum, noise_variance: float) -> Floats:
    """Inverse of the Gauss-Newton Hessian with a Gaussian prior of the uniform one's variance."""
    information = at.jacobian.T @ at.jacobian / noise_variance
    return np.asarray(np.linalg.inv(information + UNIFORM_PRECISION * np.eye(len(at.u))))


def _global_optimum(problem: _Problem) -> _Optimum:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior."""
    try:
        from scipy.stats import qmc
    except ImportError:
        raise MissingLibraryError("identify needs scipy: pip install 'soilml[ground]'") from None
    free = problem.free
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    sobol = qmc.Sobol(len(free), scramble=True, rng=7).random(SOBOL_POINTS)
    starts = np.vstack([nominal, sobol])
    prediction = problem.predict(starts)
    if np.isnan(prediction).any(axis=1).all():
        raise FitError(
            "no parameters in the prior carry the measured loads: check load_N, kphi, n and [gear]"
        )
    order = np.argsort((problem.whitened(prediction) ** 2).sum(axis=1), kind="stable")
    found: list[_Optimum] = []
    for i in dict.fromkeys([int(i) for i in order[:STARTS]] + [0]):  # the nominal point too
        found.append(_descend(problem, starts[i]))
        if len(found) == 2 and np.abs(found[0].u - found[1].u).max() < SAME_OPTIMUM:
            break
    lowest = min(optimum.cost for optimum in found)
    equal = [optimum for optimum in found if optimum.cost <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.u - 0.5) ** 2)))


def _descend(problem: _Problem, start: Floats, prior_precision: float = 0.0) -> _Optimum:
    """The local optimum from a start, with a Gaussian prior of this precision about the middle."""
    from scipy.optimize import least_squares

    latest: dict[bytes, tuple[Floats, Floats]] = {}  # scipy asks for residual and Jacobian apart

    def linearised(u: Floats) -> tuple[Floats, Floats]:
        key = u.tobytes()
        if key not in latest:
            latest.clear()
            latest[key] = problem.linearised(u)
        return latest[key]

    prior_root = np.sqrt(prior_precision)
    found = least_squares(
        lambda u: np.append(linearised(u)[0], prior_root * (u - 0.5)),
        np.clip(start, 1e-6, 1.0 - 1e-6),
        jac=lambda u: np.vstack([linearised(u)[1], prior_root * np.eye(len(u))]),
        bounds=(0.0, 1.0),
        ftol=1e-10,
        xtol=1e-9,
        gtol=1e-10,
    )
    residual, jacobian = linearised(found.x)
    return _Optimum(u=found.x, residual=residual, jacobian=jacobian)


def _initial_noise(data: Observations) -> Floats:
    """A fraction of each channel's RMS reading, (k,)."""
    parts = []
    for channel in data.channels:
        reading = channel.reading[np.isfinite(channel.reading)]
        rms = float(np.sqrt(np.mean(reading**2)))
        parts.append(np.full(reading.size, INITIAL_NOISE * rms + 1e-12))
    return np.concatenate(parts)


def _residual_noise(data: Observations, reading: Floats, residual: Floats, p: int) -> Floats:
    """Noise of each channel (k,) from its residuals, p parameters shared among all readings."""
    start, parts = 0, []
    for channel in data.channels:
        size = int(np.isfinite(channel.reading).sum())
        own = residual[start : start + size]
        freedom = max(size - p * size / reading.size, 1.0)
        rms = float(np.sqrt(np.mean(reading[start : start + size] ** 2)))
        std = max(float(np.sqrt(own @ own / freedom)), 1e-6 * rms + 1e-15)
        parts.append(np.full(size, std))
        start += size
    return np.concatenate(parts)
