"""Weighted least squares of the full model: problem, optimum, and descents from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError, MissingLibraryError
from soilml.identification.data.observations import Observations
from soilml.identification.free_parameters import FreeParameter, values_at
from soilml.identification.predictions import (
    linearise,
    noise_at_prediction,
    predict_channels,
    propagated_input_noise,
    stack_channels,
)
from soilml.identification.shared_errors.sensor_columns import sensor_columns
from soilml.numerics.noise_and_process import Whitener
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.sobol_points import sobol_points

Floats = NDArray[np.float64]

#: How many of the best of the Sobol points of the prior are descended from.
STARTS = 4
#: Tolerance of a descent; and of those from several starts, which only tell optima apart.
TOLERANCE, START_TOLERANCE = 1e-10, 1e-7
#: Predictions of the starts that are held at a time: 8 MB, and the model's own arrays beside them.
MOST_PREDICTIONS = 1_000_000
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02
#: Residual, in standard deviations, of a row that has no equilibrium at a trial.
NO_EQUILIBRIUM = 1e3


@dataclass(frozen=True)
class Optimum:
    """A local optimum."""

    u: Floats  # (p,) fractions of the priors
    residual: Floats  # (k,) of unit covariance
    jacobian: Floats  # (k, p)
    prior_cost: float  # squared deviations from normal priors

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class LeastSquaresProblem:
    """Readings, their noise and the model that is fitted to them."""

    case: Case
    data: Observations
    free: Sequence[FreeParameter]  # those of the soil, then errors
    errors: int  # how many of them are errors that all rows share
    reading: Floats  # (k,)
    std: Floats  # (k,)
    columns: Floats  # (k, q) of the model discrepancy
    shared: Floats  # (k, e) of errors that all rows share

    @cached_property
    def whitener(self) -> Whitener:
        """Inverse root of the covariance of noise, discrepancy and shared errors."""
        return Whitener.of(self.std, np.hstack([self.columns, self.shared]))

    @cached_property
    def normal_std(self) -> Floats:
        """Standard deviation of each normal prior, (p,); infinite where the prior is uniform."""
        return np.asarray([f.normal_std or f.prior.normal_std or np.inf for f in self.free])

    @cached_property
    def prior_precision(self) -> Floats:
        """Precision (p,) of each prior, in fractions."""
        return np.asarray([f.fraction_precision for f in self.free])

    def normal_deviation(self, u: Floats) -> tuple[Floats, Floats]:
        """Values over the standard deviations of normal priors, and derivatives by u; (p,) each.

        Zero where the prior is uniform.
        """
        values, rates = values_at(self.free, u)
        return values / self.normal_std, rates / self.normal_std

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

    def with_noise_at(self, optimum: Optimum) -> LeastSquaresProblem:
        """The same problem, noise taken at the optimum's predictions or from its residuals.

        Errors of sensors that all rows share are in proportion to the same predictions.
        """
        case, data, free = self.case, self.data, self.free
        prediction = self.predict(optimum.u[None, :])
        declared = noise_at_prediction(case, data, prediction)[0]
        slip_std, load_std = data.slip_std, data.load_std
        from_inputs = propagated_input_noise(case, free, optimum.u, data.at, slip_std, load_std)
        total = np.hypot(declared, stack_channels(data, from_inputs)[0])
        estimated = _residual_noise(
            data, self.reading, self.residual(prediction)[0], len(free) - self.errors
        )
        std = np.where(np.isfinite(total), total, estimated)
        sensors = sensor_columns(data, prediction)
        shared = self.shared if sensors is None else sensors[0]
        return replace(self, std=std, shared=shared)


def global_optimum(problem: LeastSquaresProblem) -> Optimum:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior.

    Descents start without errors that all rows share.
    """
    free, errors = problem.free, problem.errors
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    soils = sobol_points(len(free) - errors)
    starts = np.vstack([nominal, np.hstack([soils, np.full((len(soils), errors), 0.5)])])
    few = max(1, MOST_PREDICTIONS // problem.reading.size)  # sets of predictions held at a time
    blocks = [starts[i : i + few] for i in range(0, len(starts), few)]
    costs, feasible = [], False
    for block in blocks:
        prediction = problem.predict(block)
        feasible = feasible or not np.isnan(prediction).any(axis=1).all()
        costs.append((problem.whitened(prediction) ** 2).sum(axis=1))
    if not feasible:
        raise FitError(
            "no parameters in the prior carry the measured loads: check load_N, kphi, n and [gear]"
        )
    order = np.argsort(np.concatenate(costs), kind="stable")
    found: list[Optimum] = []
    for i in dict.fromkeys([int(i) for i in order[:STARTS]] + [0]):  # the nominal point too
        found.append(descend(problem, starts[i], tolerance=START_TOLERANCE))
        if len(found) == 2 and np.abs(found[0].u - found[1].u).max() < SAME_OPTIMUM:
            break
    lowest = min(optimum.cost + optimum.prior_cost for optimum in found)
    equal = [o for o in found if o.cost + o.prior_cost <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.u - 0.5) ** 2)))


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    *,
    with_prior: bool = False,
    tolerance: float = TOLERANCE,
) -> Optimum:
    """The local optimum from a start, normal priors included.

    It ends where cost, step and gradient change by less than the tolerance, relative.

    With `with_prior`, uniform priors are included too, as Gaussian ones of the same variance about
    their middle.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise MissingLibraryError("identify needs scipy: pip install 'soilml[ground]'") from None

    latest: dict[bytes, tuple[Floats, Floats]] = {}  # scipy asks for residual and Jacobian apart

    def linearised(u: Floats) -> tuple[Floats, Floats]:
        key = u.tobytes()
        if key not in latest:
            latest.clear()
            latest[key] = problem.linearised(u)
        return latest[key]

    uniform = np.isinf(problem.normal_std)
    uniform_root = np.where(uniform, np.sqrt(UNIFORM_PRECISION if with_prior else 0.0), 0.0)

    def prior(u: Floats) -> tuple[Floats, Floats]:
        """Deviations (p,) from the priors in standard deviations, and their derivatives (p,)."""
        z, rate = problem.normal_deviation(u)
        return z + uniform_root * (u - 0.5), rate + uniform_root

    found = least_squares(
        lambda u: np.append(linearised(u)[0], prior(u)[0]),
        np.clip(start, 1e-6, 1.0 - 1e-6),
        jac=lambda u: np.vstack([linearised(u)[1], np.diag(prior(u)[1])]),
        bounds=(0.0, 1.0),
        ftol=tolerance,
        xtol=10.0 * tolerance,
        gtol=tolerance,
    )
    residual, jacobian = linearised(found.x)
    from_prior = problem.normal_deviation(found.x)[0]
    return Optimum(found.x, residual, jacobian, float(from_prior @ from_prior))


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
