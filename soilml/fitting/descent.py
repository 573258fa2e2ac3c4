"""Weighted least squares of the full model: problem, optimum, and descents from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError, MissingLibraryError
from soilml.fitting.channel_predictions import (
    Linearisation,
    linearise,
    noise_at_prediction,
    predict_channels,
    propagated_input_noise,
    stack_channels,
)
from soilml.fitting.free_parameters import (
    FreeParameter,
    soil_test_deviations,
    soil_test_rates,
    values_at,
)
from soilml.fitting.noise_and_process import Whitener
from soilml.fitting.observations import Observations
from soilml.fitting.shared_errors_sensor_columns import sensor_columns
from soilml.fitting.spread_rows import spread_rows
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.resampling import sobol_points

Floats = NDArray[np.float64]

#: How many of the best of the Sobol points of the prior are descended from.
STARTS = 4
#: Tolerance of a descent; and of those from several starts, which only tell optima apart.
TOLERANCE, START_TOLERANCE = 1e-10, 1e-5
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
#: A descent that comes this close to an optimum of equal cost ends there.
NEARLY_SAME = 3e-2
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02
#: Residual, in standard deviations, of a row that has no equilibrium at a trial.
NO_EQUILIBRIUM = 1e3


@dataclass(frozen=True)
class Optimum:
    """A local optimum, or a trial on the way to it."""

    u: Floats  # (p,) fractions of the priors
    residual: Floats  # (k,) of unit covariance
    jacobian: Floats  # (k, p)
    prior_cost: float  # squared deviations from normal priors and from tests of the soil
    about: Linearisation  # of the readings

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

    def of_soil_tests(self, u: Floats) -> tuple[Floats, Floats]:
        """Deviations (t,) from tests of the soil at u (p,), and their derivatives (t, p) by u."""
        deviation = soil_test_deviations(self.case, self.free, u[None, :])[0]
        return deviation, soil_test_rates(self.case, self.free, u)

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

    def linearised(self, u: Floats, near: Linearisation | None) -> Optimum:
        """The problem at u (p,), found from a linearisation `near` it where there is one."""
        about = linearise(self.case, self.data, self.free, u, near)
        jacobian = self.whitener(np.nan_to_num(about.jacobian).T).T
        from_prior = np.append(self.normal_deviation(u)[0], self.of_soil_tests(u)[0])
        prior_cost = float(from_prior @ from_prior)
        return Optimum(u, self.whitened(about.prediction), jacobian, prior_cost, about)

    def of_rows(self, rows: NDArray[np.int64]) -> LeastSquaresProblem:
        """The problem of some of the rows alone."""
        chosen = np.isin(np.arange(len(self.data.slip)), rows)
        kept = np.concatenate([chosen[np.isfinite(c.reading)] for c in self.data.channels])
        return replace(
            self,
            data=self.data.of_rows(np.flatnonzero(chosen)),
            reading=self.reading[kept],
            std=self.std[kept],
            columns=self.columns[kept],
            shared=self.shared[kept],
        )

    def with_noise_at(self, optimum: Optimum) -> LeastSquaresProblem:
        """The same problem, noise taken at the optimum's predictions or from its residuals.

        Errors of sensors that all rows share are in proportion to the same predictions.
        """
        case, data, free = self.case, self.data, self.free
        prediction = optimum.about.prediction[None, :]
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
    starts, order = _ranked_starts(problem)
    found: list[Optimum] = []
    for i in dict.fromkeys([*order[:STARTS], 0]):  # the nominal point too
        # two descents that end at the same optimum are enough
        known = found[0] if len(found) == 1 else None
        optimum = descend(problem, starts[i], tolerance=START_TOLERANCE, known=known)
        if known is not None and np.abs(known.u - optimum.u).max() < SAME_OPTIMUM:
            break
        found.append(optimum)
    if not any(np.isfinite(o.about.prediction).all() for o in found) and not any(
        np.isfinite(problem.predict(start[None, :])).all() for start in starts
    ):
        raise FitError(
            "no parameters in the prior carry the measured loads: check load_N, kphi, n and [gear]"
        )
    lowest = min(optimum.cost + optimum.prior_cost for optimum in found)
    equal = [o for o in found if o.cost + o.prior_cost <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.u - 0.5) ** 2)))


def _ranked_starts(problem: LeastSquaresProblem) -> tuple[Floats, list[int]]:
    """Points (n, p) of the prior, the nominal one first, and their order by rising cost.

    Few rows tell good starts from bad ones.
    """
    free = problem.free
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    soils = sobol_points(len(free) - problem.errors)
    without = np.full((len(soils), problem.errors), 0.5)
    starts = np.vstack([nominal, np.hstack([soils, without])])
    part = problem.of_rows(spread_rows(problem.data))
    costs = (part.whitened(part.predict(starts)) ** 2).sum(axis=1)
    costs += (soil_test_deviations(problem.case, free, starts) ** 2).sum(axis=1)
    return starts, [int(i) for i in np.argsort(costs, kind="stable")]


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    *,
    with_prior: bool = False,
    tolerance: float = TOLERANCE,
    known: Optimum | None = None,
    near: Linearisation | None = None,
) -> Optimum:
    """The local optimum from a start, with normal priors and tests of the soil.

    It ends where cost, step and gradient change by less than the tolerance, relative; and with
    `known`, if it comes as close to that optimum as tells that it would end there. A linearisation
    `near` the start saves the search for equilibrium there.

    With `with_prior`, uniform priors are included too, as Gaussian ones of the same variance about
    their middle.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise MissingLibraryError("identify needs scipy: pip install 'soilml[ground]'") from None

    # scipy asks for residual and Jacobian apart, and a rejected step returns to the point before
    latest: dict[bytes, Optimum] = {}

    def linearised(u: Floats) -> Optimum:
        key = u.tobytes()
        if key not in latest:
            before = next(reversed(latest.values())).about if latest else near
            latest[key] = problem.linearised(u.copy(), before)
            while len(latest) > 2:
                del latest[next(iter(latest))]
            if known is not None and _leads_to(known, latest[key]):
                raise _SameOptimumError(known)
        return latest[key]

    uniform = np.isinf(problem.normal_std)
    uniform_root = np.where(uniform, np.sqrt(UNIFORM_PRECISION if with_prior else 0.0), 0.0)

    def prior(u: Floats) -> tuple[Floats, Floats]:
        """Deviations (p,) from the priors in standard deviations, and their derivatives (p,)."""
        z, rate = problem.normal_deviation(u)
        return z + uniform_root * (u - 0.5), rate + uniform_root

    try:
        found = least_squares(
            lambda u: np.concatenate(
                [linearised(u).residual, prior(u)[0], problem.of_soil_tests(u)[0]]
            ),
            np.clip(start, 1e-6, 1.0 - 1e-6),
            jac=lambda u: np.vstack(
                [linearised(u).jacobian, np.diag(prior(u)[1]), problem.of_soil_tests(u)[1]]
            ),
            bounds=(0.0, 1.0),
            ftol=tolerance,
            xtol=10.0 * tolerance,
            gtol=tolerance,
        )
    except _SameOptimumError as same:
        return same.optimum
    return linearised(found.x)


class _SameOptimumError(Exception):
    """A descent has come close to an optimum that is known."""

    def __init__(self, optimum: Optimum) -> None:
        super().__init__()
        self.optimum = optimum


def _leads_to(known: Optimum, trial: Optimum) -> bool:
    """Whether a descent at a trial ends at a known optimum.

    It does where it is close, and the cost is the known optimum's quadratic; fewer readings than
    parameters leave a valley of equal cost, whose points count as different.
    """
    distance = trial.u - known.u
    if np.abs(distance).max() > NEARLY_SAME or len(trial.residual) < len(trial.u):
        return False
    excess = trial.cost + trial.prior_cost - known.cost - known.prior_cost
    quadratic = float(np.sum((known.jacobian @ distance) ** 2))
    return abs(excess - quadratic) < EQUAL_COST


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
