"""Bounded Levenberg-Marquardt descents of least-squares problems."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import LeastSquaresProblem, PriorTerms, Solution
from soilml.fitting.predictions import Linearisation

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
    #: (p,) What is added to a coordinate to obtain a multiple of the parameter, where the parameter
    #: moves by ratios; infinite where it moves by differences
    offset: Floats
    terms: PriorTerms  # Priors and tests of the soil, which stand beside the residuals

    @staticmethod
    def of(problem: LeastSquaresProblem) -> DampedSteps:
        """The steps of a problem."""
        offset = np.asarray([_offset(c) for c in problem.coordinates])
        return DampedSteps(problem.lower, problem.upper, offset, problem.terms)

    def within(self, x: Floats) -> Floats:
        """Coordinates (..., p), moved to the bounds that they are beyond."""
        return np.clip(x, self.lower, self.upper)

    def proposed(
        self, x: Floats, residual: Floats, jacobian: Floats, damping: Floats
    ) -> tuple[float, Floats]:
        r"""What an undamped step from x (p,) promises, and where damped ones lead, (b, p).

        .. math:: (J^T J + P + \lambda\, \mathrm{diag}(J^T J + P))\, \Delta u
            = J^T r - T^T z

        with the deviations z from priors and soil tests, their derivatives T, and P = T^T T. Where
        a step meets a bound, the others are those that belong to it. The promise is the decrease of
        the linearised objective, up to the bounds.

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
        return of_readings - np.stack(of_terms)

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
        return np.asarray(gram + rates.swapaxes(1, 2) @ rates)

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


def descend_each(
    problems: Sequence[LeastSquaresProblem],
    starts: Sequence[Floats],
    known: Sequence[Linearisation | None],
) -> list[Solution | InputError]:
    """Descents of problems from starts (p,); the error of one whose trials the model refuses."""
    found: list[Solution | InputError] = []
    for problem, start, near in zip(problems, starts, known, strict=True):
        try:
            found.append(descend(problem, start, near=near))
        except InputError as error:
            found.append(error)
    return found


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    tolerance: Tolerance = FINE,
    near: Linearisation | None = None,
) -> Solution:
    """Bounded Levenberg-Marquardt descent from one start (p,), moved within the bounds.

    As long as the linearised model keeps its promise, each iteration is one step, at the end of
    which the model is linearised again. Else several dampings are tried first and, where none keeps
    the promise, each with a correction by what of the model is not linear. Trials start at the
    sinkage that the last iterate predicts. An iterate is solved by the full search; it is no
    improvement where that finds an equilibrium before the one of the trial.

    near: A linearisation that saves the search for equilibrium, where it is at the start.

    Raises `InputError` where the model refuses the coordinates of a trial.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 10.3.
    """
    steps = DampedSteps.of(problem)
    x = steps.within(start)
    known = near is not None and np.array_equal(near.x, x)
    last = problem.at(x, near) if near is not None and known else problem.linearised(x)
    damping, converged, trusted = FIRST_DAMPING, False, True
    passed: deque[float] = deque(maxlen=tolerance.iterations)  # objectives before iterations
    for _ in range(MAX_ITERATIONS):
        excess = last.objective - len(last.residual)
        dampings = damping * np.asarray(DAMPING_FACTORS)
        promised, here = steps.proposed(last.x, last.residual, last.jacobian, dampings)
        share = tolerance.share * excess
        given = passed[0] - last.objective if len(passed) == passed.maxlen else np.inf
        least, slow = max(tolerance.enough, share), max(tolerance.creeping, share)
        converged = promised < least or given < slow
        if converged:
            break
        passed.append(last.objective)
        if trusted:
            new = problem.linearised(here[0], last.linearisation)
            improvement = last.objective - new.objective
            trusted = improvement > KEPT_PROMISE * promised
            if improvement > 0.0:
                last, damping = new, max(float(dampings[0]), MIN_DAMPING)
                continue
        tried, objectives = _trials(problem, steps, last, here, dampings, KEPT_PROMISE * promised)
        best = int(np.argmin(objectives))
        improvement = last.objective - float(objectives[best])
        if improvement > 0.0:
            new = problem.linearised(tried[best], last.linearisation)
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


def _trials(
    problem: LeastSquaresProblem,
    steps: DampedSteps,
    last: Solution,
    here: Floats,
    dampings: Floats,
    enough: float,
) -> tuple[Floats, Floats]:
    """Points (b, p) and their objectives (b,): with corrected ones where none gives `enough`."""

    def whitened(x: Floats) -> Floats:
        sinkage = replace(last.linearisation.sinkage_at(x), nearest=True)
        return problem.whitened(problem.predict(x, sinkage))

    bent = whitened(here)
    objectives = problem.objective(bent, here)
    if last.objective - float(objectives.min()) >= enough:
        return here, objectives
    back = steps.corrected(last, here, bent, dampings)
    corrected = problem.objective(whitened(back), back)
    return np.vstack([here, back]), np.concatenate([objectives, corrected])
