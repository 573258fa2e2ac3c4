"""Bounded Levenberg-Marquardt descents of least-squares problems, many in step."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError, raised
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import (
    LeastSquaresProblem,
    PriorTerms,
    SoilTestTerms,
    Solution,
)
from soilml.fitting.predictions import (
    Linearisation,
    PredictionRequest,
    linearise_many,
    predict_many,
)

T = TypeVar("T")

#: Iterations after which a descent is abandoned as not converged; typical fits need five to ten.
MAX_ITERATIONS = 50
#: A step that achieves this fraction of what the linearised model promises is followed by one step
#: alone, and else by a choice of several. Where none of these does, they are corrected too.
KEPT_PROMISE = 0.5
#: Levenberg-Marquardt damping: the first value, the factors that are tried in each iteration, the
#: factor after an iteration without improvement, and the bounds.
FIRST_DAMPING, DAMPING_FACTORS, DAMPING_INCREASE = 1e-3, (0.1, 0.3, 1.0, 10.0), 1e2
MIN_DAMPING, MAX_DAMPING = 1e-9, 1e9
#: Damping, and curvature of a coordinate that changes nothing, with which a step is defined.
LEAST_DAMPING, LEAST_SCALE = 1e-9, 1e-9
#: A parameter whose positive bounds differ by this ratio moves by ratios: valleys of the objective
#: along it and an exponent are straight in its logarithm.
RATIO_OF_BOUNDS = 3.0
MOST_LOG_STEP = 2.0  # Largest increase of the logarithm of such a parameter in one step


@dataclass(frozen=True)
class Tolerance:
    """Where a descent has converged, in decreases of its objective.

    The linearised model promises less than `enough`, or less than the fraction `share` of the
    excess over the number of readings (while the model is far from the data); the best of several
    steps gives less than `enough` or `step_share`; or `iterations`, which creep, have together
    given less than `creeping` or `share`.
    """

    enough: float
    share: float
    step_share: float
    iterations: int
    creeping: float


#: For estimates: far below the thresholds on differences of the objective, which start at 9.
FINE = Tolerance(enough=0.01, share=5e-4, step_share=2e-3, iterations=4, creeping=0.15)
#: For the least squares of `identify`, and for its descents that only tell optima apart.
EXACT = Tolerance(enough=1e-9, share=0.0, step_share=0.0, iterations=50, creeping=0.0)
APART = Tolerance(enough=1e-4, share=1e-5, step_share=1e-5, iterations=50, creeping=0.0)
#: For fits that are compared first, of which those near the best go on to the fine one.
COARSE = Tolerance(enough=0.5, share=0.01, step_share=0.01, iterations=3, creeping=1.0)


@dataclass(frozen=True)
class DampedSteps:
    """Steps in the coordinates of a fit: their bounds, priors and curvature."""

    lower: Floats  # (p,) bounds, at which steps end
    upper: Floats
    precision: Floats  # (p,) of each coordinate's normal density about zero, or 0
    #: (p,) What is added to a coordinate to obtain a multiple of the parameter, where the parameter
    #: moves by ratios; infinite where it moves by differences
    offset: Floats
    #: Tests of the soil and priors, which stand beside the residuals
    terms: SoilTestTerms | PriorTerms = field(default_factory=SoilTestTerms)

    @staticmethod
    def of(problem: LeastSquaresProblem) -> DampedSteps:
        """The steps of a problem."""
        offset = np.asarray([_offset(c) for c in problem.coordinates])
        bounds = problem.lower, problem.upper
        return DampedSteps(*bounds, problem.precision, offset, problem.terms)

    def within(self, x: Floats) -> Floats:
        """Coordinates (..., p), moved to the bounds that they are beyond."""
        return np.clip(x, self.lower, self.upper)

    def proposed(
        self, x: Floats, residual: Floats, jacobian: Floats, damping: Floats
    ) -> tuple[float, Floats]:
        r"""What an undamped step from x (p,) promises, and where damped ones lead, (b, p).

        .. math:: (J^T J + P + \lambda\, \mathrm{diag}(J^T J + P))\, \Delta u
            = J^T r - P_0 x - T^T z

        with the deviations z from soil tests, their derivatives T, the precision P_0 of the priors,
        and P = P_0 + T^T T. Where a step meets a bound, the others are those that belong to it. The
        promise is the decrease of the linearised objective, up to the bounds.

        residual (m,), jacobian (m, p): Whitened residuals and derivatives of the readings there.
        damping (b,): Factor lambda of each step.
        """
        here, factors = x[None], np.append(LEAST_DAMPING, damping)
        normal = self._normal(here, jacobian.T @ jacobian).repeat(len(factors), axis=0)
        descent = self._descent(here, residual @ jacobian).repeat(len(factors), axis=0)
        full, *damped = self._steps(here.repeat(len(factors), axis=0), descent, normal, factors)
        promised = float(2.0 * descent[0] @ full - full @ normal[0] @ full)
        return promised, self.within(self.moved(x, np.asarray(damped)))

    def corrected(self, last: Solution, x: Floats, residual: Floats, damping: Floats) -> Floats:
        r"""Points x (b, p) that steps led to, corrected by what of the model is not linear.

        .. math:: (J^T J + P + \lambda\, \mathrm{diag}(J^T J + P))\, \Delta u
            = J^T (r - r_0 + J\, \delta u)

        with the residuals r (b, m) at these points, r_0 and J at the iterate, and the steps from
        it. That leads back to the floor of a curved valley, and no further along it.

        References: Transtrum and Sethna, arXiv:1201.5885, 2012 (geodesic acceleration).
        """
        step = np.stack([self._between(last.x, to) for to in x])
        bent = residual - last.residual + step @ last.jacobian.T
        normal = self._normal(x, last.jacobian.T @ last.jacobian)
        return self.within(self.moved(x, self._steps(x, bent @ last.jacobian, normal, damping)))

    def _descent(self, x: Floats, of_readings: Floats) -> Floats:
        """Half the negative gradient (b, p) at points (b, p), from that of the readings."""
        of_terms = [self.terms.rates(one).T @ self.terms.deviation(one) for one in x]
        return of_readings - self.precision * x - np.stack(of_terms)

    def _steps(self, x: Floats, descent: Floats, normal: Floats, damping: Floats) -> Floats:
        """Damped steps (b, p) from points (b, p).

        descent (b, p): Half the negative gradient there.
        normal (b, p, p): Half the curvature of the linearised objective at each point.
        """
        held = ((x <= self.lower) & (descent < 0)) | ((x >= self.upper) & (descent > 0))
        damped, i = normal.copy(), np.arange(x.shape[1])
        damped[:, i, i] += damping[:, None] * (normal[:, i, i] + LEAST_SCALE)
        return bounded_steps(damped, descent, ~held, *self._ends(x))

    def _between(self, x: Floats, to: Floats) -> Floats:
        """The step (p,) from coordinates (p,) to others; see `moved`."""
        multiple = x + self.offset
        with np.errstate(invalid="ignore"):
            growth = multiple * np.log1p((to - x) / multiple)
        return np.where(np.isfinite(multiple), growth, to - x)

    def _normal(self, x: Floats, gram: Floats) -> Floats:
        """Half the curvature (b, p, p) of the linearised objective at points (b, p).

        gram (p, p): That of the readings.
        """
        rates = np.stack([self.terms.rates(one) for one in x])
        return np.asarray(gram + np.diag(self.precision) + rates.swapaxes(1, 2) @ rates)

    def moved(self, x: Floats, step: Floats) -> Floats:
        """Coordinates (..., p) after steps: those that move by ratios follow an exponential."""
        multiple = x + self.offset
        with np.errstate(invalid="ignore"):
            growth = np.expm1(np.minimum(step / multiple, MOST_LOG_STEP))
            return np.where(np.isfinite(multiple), x + multiple * growth, x + step)

    def _ends(self, x: Floats) -> tuple[Floats, Floats]:
        """The steps (b, p) from coordinates (b, p) to the lower and to the upper bounds."""
        low, high = self.lower - x, self.upper - x
        by_ratio = np.isfinite(self.offset)
        of = x[:, by_ratio] + self.offset[by_ratio]
        low[:, by_ratio] = of * np.log1p(low[:, by_ratio] / of)
        high[:, by_ratio] = of * np.minimum(np.log1p(high[:, by_ratio] / of), MOST_LOG_STEP)
        return low, high


def bounded_steps(
    normal: Floats, descent: Floats, free: NDArray[np.bool_], low: Floats, high: Floats
) -> Floats:
    r"""Steps of the free coordinates that lower quadratic functions between bounds, (b, p).

    .. math:: \tfrac{1}{2}\, \Delta u^T N\, \Delta u - d^T \Delta u

    Whenever a coordinate meets a bound on the way to the minimum, it stays there, and the others
    go on to the minimum that belongs to it. To leave coordinates outside their bounds and move them
    back afterwards would leave the valley of a function whose minimum lies far outside.

    normal (b, p, p), descent (b, p): N and d of each function.
    free (b, p): The coordinates that move.
    low, high (b, p): Bounds of the step, around zero.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 16.5 (active sets).
    """
    step, free = np.zeros_like(descent), free.copy()
    each, identity = np.arange(len(descent)), np.eye(descent.shape[1])
    while True:
        # the step of a coordinate that is not free stays what it is
        moving = free[:, :, None] & free[:, None, :]
        fixed = np.where(free, 0.0, step)
        left = np.where(free, descent - (normal @ fixed[:, :, None])[:, :, 0], fixed)
        change = np.linalg.solve(np.where(moving, normal, identity), left[:, :, None])[:, :, 0]
        change -= step
        room = np.where(change < 0.0, low, high) - step
        beyond = free & (np.abs(change) > np.abs(room))
        if not beyond.any():
            return np.asarray(step + change)
        share = np.where(beyond, room / np.where(beyond, change, 1.0), 1.0)
        first = share.argmin(axis=1)
        step = step + share[each, first, None] * change
        met = each[beyond.any(axis=1)]
        at = met, first[met]
        step[at] = np.where(change[at] < 0.0, low[at], high[at])
        free[at] = False


def _offset(coordinate: Coordinate) -> float:
    prior = coordinate.prior
    positive = prior.lower > 0.0 and prior.upper > RATIO_OF_BOUNDS * prior.lower
    if prior.log or prior.normal_std is not None or not positive:
        return float("inf")
    return prior.lower / (prior.upper - prior.lower)


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    tolerance: Tolerance = FINE,
    near: Linearisation | None = None,
) -> Solution:
    """Bounded Levenberg-Marquardt descent from one start (p,); see `descend_together`.

    near: A linearisation that saves the search for equilibrium, where it is at the start.

    Raises `InputError` where the model refuses the coordinates of a trial.
    """
    (fit,) = in_step([descent(problem, start, near, tolerance)])
    return raised(fit)


def descend_together(
    problems: Sequence[LeastSquaresProblem],
    starts: Sequence[Floats],
    known: Sequence[Linearisation | None] | None = None,
) -> list[Solution | InputError]:
    """Bounded Levenberg-Marquardt descents, in step, so that each call of the model serves all.

    Each starts at coordinates (p,), clipped to the bounds. The descents are independent; the result
    of each is that of a descent alone, within the tolerance of the search for equilibrium. Where
    the model refuses the coordinates of a trial, its `InputError` takes the place of the solution.

    known: Linearisations of the problems that may be at their starts; one that is spares the first
        call of the model.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 10.3.
    """
    near = known or [None] * len(problems)
    return in_step([descent(*own) for own in zip(problems, starts, near, strict=True)])


@dataclass(frozen=True)
class ModelQuestion:
    """What a descent asks of the model: predictions, or a linearisation."""

    request: PredictionRequest
    linearise: bool


#: Work that asks questions of the model, is sent the answers, and returns what it found. It may be
#: several descents, one after the other.
Asking: TypeAlias = Generator[ModelQuestion, Any, T]


def in_step(works: Sequence[Asking[T]]) -> list[T | InputError]:
    """What works return that go on in step, so that each call of the model serves all.

    The `InputError` of a question that the model refuses is raised where it was asked; one that is
    not caught there takes the place of the result.
    """
    results: dict[int, T | InputError] = {}
    asked: dict[int, ModelQuestion] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(works)))
    while answers:
        for i, answer in answers.items():
            asked.pop(i, None)
            refused = isinstance(answer, InputError)
            try:
                asked[i] = works[i].throw(answer) if refused else works[i].send(answer)
            except StopIteration as end:
                results[i] = end.value
            except InputError as error:
                results[i] = error
        answers = _answers(asked) if asked else {}
    return [results[i] for i in range(len(works))]


def _answers(asked: Mapping[int, ModelQuestion]) -> dict[int, Floats | Linearisation | InputError]:
    """The answers to the questions of one kind, predictions first.

    Descents that ask for a linearisation wait until all do, so that one call serves them.
    """
    these = [i for i, question in asked.items() if not question.linearise]
    answer: Callable[..., Sequence[Floats | Linearisation | InputError]] = predict_many
    if not these:
        these, answer = list(asked), linearise_many
    return dict(zip(these, answer([asked[i].request for i in these]), strict=True))


def descent(
    problem: LeastSquaresProblem,
    start: Floats,
    known: Linearisation | None = None,
    tolerance: Tolerance = FINE,
) -> Asking[Solution]:
    """One descent; see `descend_together`.

    As long as the linearised model keeps its promise, each iteration is one step, at the end of
    which the model is linearised again. Else several dampings are tried first and, where none keeps
    the promise, each with a correction by what of the model is not linear. Trials start at the
    sinkage that the last iterate predicts. An iterate is solved by the full search; it is no
    improvement where that finds an equilibrium before the one of the trial.
    """
    steps = DampedSteps.of(problem)

    def at(last: Solution, x: Floats) -> ModelQuestion:
        sinkage = last.linearisation.sinkage_at((x - last.x)[None, :])
        return ModelQuestion(problem.request(x[None, :], sinkage), linearise=True)

    def trials(last: Solution, x: Floats) -> ModelQuestion:
        sinkage = replace(last.linearisation.sinkage_at(x - last.x), nearest=True)
        return ModelQuestion(problem.request(x, sinkage), linearise=False)

    x = steps.within(start)
    if known is None or not np.array_equal(known.x, x):
        known = yield ModelQuestion(problem.request(x[None, :]), linearise=True)
    last = problem.at(x, known)
    damping, converged, trusted = FIRST_DAMPING, False, True
    passed: deque[float] = deque(maxlen=tolerance.iterations)  # objectives before iterations
    for _ in range(MAX_ITERATIONS):
        excess = last.objective - len(last.residual)
        factors = DAMPING_FACTORS[:1] if trusted else DAMPING_FACTORS
        dampings = damping * np.asarray(factors)
        promised, here = steps.proposed(last.x, last.residual, last.jacobian, dampings)
        share = tolerance.share * excess
        given = passed[0] - last.objective if len(passed) == passed.maxlen else np.inf
        least, slow = max(tolerance.enough, share), max(tolerance.creeping, share)
        converged = promised < least or given < slow
        if converged:
            break
        passed.append(last.objective)
        if trusted:
            new = problem.at(here[0], (yield at(last, here[0])))
            improvement = last.objective - new.objective
            trusted = improvement > KEPT_PROMISE * promised
            if improvement > 0.0:
                last, damping = new, max(float(dampings[0]), MIN_DAMPING)
                continue
            dampings = damping * np.asarray(DAMPING_FACTORS)
            _, here = steps.proposed(last.x, last.residual, last.jacobian, dampings)
        bent = problem.whitened((yield trials(last, here)))
        tried, objectives = here, problem.objective(bent, here)
        if last.objective - float(objectives.min()) < KEPT_PROMISE * promised:
            back = steps.corrected(last, here, bent, dampings)
            straight = problem.whitened((yield trials(last, back)))
            tried = np.vstack([here, back])
            objectives = np.concatenate([objectives, problem.objective(straight, back)])
        best = int(np.argmin(objectives))
        improvement = last.objective - float(objectives[best])
        if improvement > 0.0:
            new = problem.at(tried[best], (yield at(last, tried[best])))
            improvement = last.objective - new.objective
        if improvement <= 0.0:
            # if the most damped, shortest step is negligible this is an optimum; else damp more
            converged = float(np.abs(here[-1] - last.x).max()) < 1e-3
            damping *= DAMPING_INCREASE
            if converged or damping > MAX_DAMPING:
                break
            continue
        last, damping = new, max(float(dampings[best % len(dampings)]), MIN_DAMPING)
        trusted = improvement > KEPT_PROMISE * promised
        converged = improvement < max(tolerance.enough, tolerance.step_share * excess)
        if converged:
            break
    return replace(last, converged=converged)
