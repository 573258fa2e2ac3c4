"""Generalised least squares on the full model, bounded, with priors on some coordinates."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate, SoilCoordinate
from soilml.fitting.damped_steps import DampedSteps
from soilml.fitting.predictions import (
    Linearisation,
    PredictionRequest,
    linearise_many,
    predict_many,
)
from soilml.fitting.readings import Readings
from soilml.fitting.readings_by_gear import readings_by_gear
from soilml.fitting.soil_test_terms import SoilTestTerms
from soilml.fitting.whitening import Whitening
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.physics.sinkage_estimate import SinkageEstimate

Floats = NDArray[np.float64]

#: Iterations after which a descent is abandoned as not converged; typical fits need five to ten.
MAX_ITERATIONS = 25
#: Whitened residual assigned to a reading where a trial has no equilibrium: large enough that the
#: trial is rejected, finite so that trials can still be compared.
INFEASIBLE_RESIDUAL = 1e2
#: A descent has converged when a step lowers the objective by less than `ENOUGH` (far below the
#: thresholds on differences of the objective, which start at 9) or by less than the fraction
#: `SHARE` of its excess over the number of readings (while the model is far from the data).
ENOUGH, SHARE = 0.01, 2e-3
#: Levenberg-Marquardt damping: the first value, the factors that are tried in each iteration, the
#: factor after an iteration without improvement, and the bounds.
FIRST_DAMPING, DAMPING_FACTORS, DAMPING_INCREASE = 1e-3, (0.1, 1.0, 10.0), 1e2
MIN_DAMPING, MAX_DAMPING = 1e-9, 1e9


@dataclass(frozen=True)
class Solution:
    """An optimum of generalised least squares: coordinates, residuals, Jacobian and objective.

    `objective` is the sum of squared whitened residuals, of squared coordinates over their prior
    variances, and of squared deviations from tests of the soil; `converged` is false where the
    iteration limit was reached.
    """

    case: Case
    coordinates: tuple[Coordinate, ...]
    x: Floats  # (p,)
    prediction: Floats  # (m,)
    residual: Floats  # (m,) whitened
    jacobian: Floats  # (m, p) whitened
    objective: float
    converged: bool
    reading: Floats  # (m,)
    derivatives: Floats  # (m, p) Jacobian in the readings' unit

    def whitened_by(self, whiten: Whitening) -> Solution:
        """The same optimum with residuals and Jacobian whitened by another matrix (m, m)."""
        residual = whiten @ (self.reading - self.prediction)
        return replace(self, residual=residual, jacobian=whiten @ self.derivatives)

    @property
    def precision(self) -> Floats:
        """Precision of the Gaussian prior of each coordinate, (p,)."""
        return np.asarray([c.std**-2 for c in self.coordinates])

    @property
    def soil_tests(self) -> SoilTestTerms:
        """Deviations from tests of the soil."""
        return SoilTestTerms(self.case, self.coordinates)

    @property
    def covariance(self) -> Floats:
        """Linearised posterior covariance of the coordinates, (p, p).

        A soil coordinate is uniform a priori; its precision enters as that of a Gaussian.
        """
        uniform = np.asarray(
            [
                UNIFORM_PRECISION if np.isinf(c.std) and isinstance(c, SoilCoordinate) else 0.0
                for c in self.coordinates
            ]
        )
        jacobian = np.vstack([self.jacobian, self.soil_tests.rates(self.x)])
        return np.asarray(np.linalg.pinv(jacobian.T @ jacobian + np.diag(self.precision + uniform)))

    def values(self) -> dict[str, float]:
        """Parameters at the optimum, by path."""
        return {
            c.path: float(c.value(self.x[i : i + 1])[0]) for i, c in enumerate(self.coordinates)
        }

    def stds(self) -> dict[str, float]:
        """Standard deviations of the parameters, by path."""
        std = np.sqrt(np.diag(self.covariance))
        return {
            c.path: float(std[i] * abs(c.rate(float(self.x[i]))))
            for i, c in enumerate(self.coordinates)
        }

    def start_values(self) -> dict[str, float]:
        """Coordinates by path, for another fit to start from."""
        return {c.path: float(x) for c, x in zip(self.coordinates, self.x, strict=True)}

    def fitted(self) -> Case:
        """The case with the parameters of the optimum."""
        return self.case.with_values(self.values())


@dataclass(frozen=True)
class FitRequest:
    """A descent to be made: its model, coordinates and data, and where it starts.

    `whiten`, (m, m), is a root of the inverse covariance of the readings, such as that of its
    Cholesky factor L;
    `start`, (p,), are the first coordinates, clipped to the bounds.
    """

    case: Case
    coordinates: Sequence[Coordinate]
    readings: Readings
    whiten: Whitening
    start: Floats


def levenberg_marquardt(
    case: Case,
    coordinates: Sequence[Coordinate],
    readings: Readings,
    whiten: Whitening,
    start: Floats,
) -> Solution:
    """Bounded Levenberg-Marquardt descent from one start; see `descend_together`.

    Raises
    ------
    InputError
        Where the model refuses the coordinates of a trial.
    """
    (fit,) = descend_together([FitRequest(case, coordinates, readings, whiten, start)])
    if isinstance(fit, InputError):
        raise fit
    return fit


def descend_together(requests: Sequence[FitRequest]) -> list[Solution | InputError]:
    r"""Bounded Levenberg-Marquardt descents, in step, so that each call of the model serves all.

    .. math:: \min_x \|L^{-1} (y - f(x))\|^2 + \sum_k (x_k / \sigma_k)^2 + \sum_i z_i(x)^2

    with the deviations z from tests of the soil. The descents are independent; the result of each
    is that of a descent alone, within the tolerance of the search for equilibrium. Where the model
    refuses the coordinates of a trial, its `InputError` takes the place of the fit.

    References
    ----------
    Nocedal and Wright, Numerical Optimization, 2006, section 10.3.
    """
    results: dict[int, Solution | InputError] = {}
    descents = [_descent(request) for request in requests]
    asked = {i: next(descent) for i, descent in enumerate(descents)}
    while asked:
        for i, answer in _answers(asked).items():
            if isinstance(answer, InputError):
                results[i] = answer
                del asked[i]
                continue
            try:
                asked[i] = descents[i].send(answer)
            except StopIteration as end:
                results[i] = end.value
                del asked[i]
    return [results[i] for i in range(len(requests))]


@dataclass(frozen=True)
class _Question:
    """What a descent asks of the model: predictions, or a linearisation."""

    request: PredictionRequest
    linearise: bool


#: A descent: asks questions, is sent the answers, and returns its fit.
_Descent: TypeAlias = Generator[_Question, Any, Solution]


def _answers(asked: Mapping[int, _Question]) -> dict[int, Floats | Linearisation | InputError]:
    """The answers to the questions of all descents."""
    answers: dict[int, Floats | Linearisation | InputError] = {}
    for linearised, answer in ((False, predict_many), (True, linearise_many)):
        these = [i for i, question in asked.items() if question.linearise == linearised]
        found = answer([asked[i].request for i in these])
        answers |= dict(zip(these, found, strict=True))
    return answers


@dataclass(frozen=True)
class _Iterate:
    """A point of a descent."""

    x: Floats  # (p,)
    model: Linearisation
    residual: Floats  # (m,) whitened
    jacobian: Floats  # (m, p) whitened
    objective: float


def _descent(request: FitRequest) -> _Descent:
    """One descent; see `descend_together`.

    Each damping is tried by a step and by a second step with the same Jacobian, which follows a
    curved valley. Trials start at the sinkage that the last iterate predicts. An iterate is solved
    by the full search; it is no improvement where that finds an equilibrium before the one of the
    trial.
    """
    coordinates, readings = tuple(request.coordinates), request.readings
    steps = DampedSteps.of(coordinates, request.case)
    gears = readings_by_gear(request.case, coordinates, readings)

    def whitened_residual(y: Floats) -> Floats:
        feasible = np.isfinite(y).all(axis=-1, keepdims=True)
        white = (request.whiten @ np.where(feasible, readings.reading - y, 0.0).T).T
        return np.where(feasible, white, INFEASIBLE_RESIDUAL)

    def asked(x: Floats, sinkage: SinkageEstimate | None) -> PredictionRequest:
        return PredictionRequest(request.case, coordinates, x, readings, sinkage, gears)

    def trial(last: _Iterate, x: Floats) -> _Question:
        sinkage = replace(last.model.sinkage_at(x - last.x), nearest=True)
        return _Question(asked(x, sinkage), linearise=False)

    def iterate(x: Floats, model: Linearisation) -> _Iterate:
        residual = whitened_residual(model.prediction)
        jacobian = request.whiten @ np.nan_to_num(model.jacobian)
        return _Iterate(x, model, residual, jacobian, float(steps.objective(residual, x)))

    x = steps.within(request.start)
    last = iterate(x, (yield _Question(asked(x[None, :], None), linearise=True)))
    damping, converged = FIRST_DAMPING, False
    for _ in range(MAX_ITERATIONS):
        if steps.are_held(last.x, last.residual, last.jacobian):
            converged = True
            break
        dampings = damping * np.asarray(DAMPING_FACTORS)
        here = np.tile(last.x, (len(dampings), 1))
        residual = np.tile(last.residual, (len(dampings), 1))
        trials, objectives = [], []
        for _ in range(2):
            here = steps.from_points(here, residual, last.jacobian, dampings)
            residual = whitened_residual((yield trial(last, here)))
            trials.append(here)
            objectives.append(steps.objective(residual, here))
        best = int(np.argmin(objectives))
        improvement = last.objective - float(np.ravel(objectives)[best])
        if improvement > 0.0:
            x = np.concatenate(trials)[best]
            sinkage = last.model.sinkage_at((x - last.x)[None, :])
            new = iterate(x, (yield _Question(asked(x[None, :], sinkage), linearise=True)))
            improvement = last.objective - new.objective
        if improvement <= 0.0:
            # if the most damped, shortest step is negligible this is an optimum; else damp more
            converged = float(np.abs(trials[0][-1] - last.x).max()) < 1e-3
            damping *= DAMPING_INCREASE
            if converged or damping > MAX_DAMPING:
                break
            continue
        last = new
        damping = max(float(dampings[best % len(dampings)]), MIN_DAMPING)
        if improvement < max(ENOUGH, SHARE * (last.objective - len(readings))):
            converged = True
            break
    return Solution(
        request.case,
        coordinates,
        last.x,
        last.model.prediction,
        last.residual,
        last.jacobian,
        last.objective,
        converged,
        readings.reading,
        np.nan_to_num(last.model.jacobian),
    )
