"""Bounded Levenberg-Marquardt descents of least-squares problems."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation

#: Iterations after which a descent is abandoned as not converged; typical fits need five to ten.
MAX_ITERATIONS = 50
#: Levenberg-Marquardt damping: the first value, its factors after a step that achieves more than
#: `KEPT_PROMISE` of what the linearised model promises of it, less, and nothing, and its bounds.
FIRST_DAMPING, KEPT_PROMISE = 1e-3, 0.5
AFTER_KEPT, AFTER_LESS, AFTER_NOTHING = 0.2, 2.0, 5.0
MIN_DAMPING, MAX_DAMPING = 1e-9, 1e9
#: Damping, and curvature of a coordinate that changes nothing, with which a step is defined.
LEAST_DAMPING, LEAST_SCALE = 1e-9, 1e-9
NEGLIGIBLE_STEP = 1e-6  # Change of all coordinates in which a step that brings nothing is the last


@dataclass(frozen=True)
class Tolerance:
    """Where a descent has converged, in decreases of its objective.

    The linearised model promises less than `enough`, or less than the fraction `share` of the
    excess over the number of readings (while the model is far from the data); or `iterations`,
    which creep, have together given less than `creeping` or `share`.
    """

    enough: float
    share: float
    iterations: int
    creeping: float


#: For estimates: far below the thresholds on differences of the objective, which start at 9.
FINE = Tolerance(enough=0.01, share=5e-4, iterations=4, creeping=0.15)
#: For the least squares of `identify`, and for its descents that only tell optima apart.
EXACT = Tolerance(enough=1e-9, share=0.0, iterations=50, creeping=0.0)
APART = Tolerance(enough=1e-4, share=1e-5, iterations=50, creeping=0.0)
#: For fits that are compared first, of which those near the best go on to the fine one.
COARSE = Tolerance(enough=0.5, share=0.01, iterations=3, creeping=1.0)


def descent_if_any(
    problem: LeastSquaresProblem, start: Floats, near: Linearisation | None = None
) -> Solution | None:
    """The descent from a start (p,); None where the model refuses its trials."""
    try:
        return descend(problem, start, near=near)
    except InputError:
        return None


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    tolerance: Tolerance = FINE,
    near: Linearisation | None = None,
) -> Solution:
    r"""Bounded Levenberg-Marquardt descent from one start (p,), moved within the bounds.

    .. math:: (N + \lambda\, \mathrm{diag}(N))\, \Delta x = J^T r - T^T z, \quad N = J^T J + T^T T

    with the whitened residuals r and derivatives J of the readings, and the deviations z from
    priors and soil tests and their derivatives T. The model is solved at the end of each step,
    searched from the sinkage that the last point predicts. Where a step gives less than half of
    what it promises, it is corrected for the curvature of the model: valleys of the objective along
    a modulus and an exponent are narrow and bent.

    near: A linearisation that saves the search for equilibrium, where it is at the start.

    Raises `InputError` where the model refuses the coordinates of a trial.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 10.3.
    """
    x = np.clip(start, problem.lower, problem.upper)
    known = near is not None and np.array_equal(near.x, x)
    last = problem.at(x, near) if near is not None and known else problem.linearised(x)
    damping, converged = FIRST_DAMPING, False
    passed: deque[float] = deque(maxlen=tolerance.iterations)  # objectives before iterations
    for _ in range(MAX_ITERATIONS):
        excess = last.objective - len(last.residual)
        share = tolerance.share * excess
        given = passed[0] - last.objective if len(passed) == passed.maxlen else np.inf
        promised, expected, x = _step(last, damping)
        converged = promised < max(tolerance.enough, share) or given < max(
            tolerance.creeping, share
        )
        if converged:
            break
        new = problem.linearised(x, last.linearisation)
        if last.objective - new.objective < KEPT_PROMISE * expected:
            bent = problem.linearised(_corrected(last, new, damping), last.linearisation)
            new = min(new, bent, key=lambda one: one.objective)
        improvement = last.objective - new.objective
        if improvement <= 0.0:
            converged = float(np.abs(x - last.x).max()) < NEGLIGIBLE_STEP
            damping *= AFTER_NOTHING
            if converged or damping > MAX_DAMPING:
                break
            continue
        passed.append(last.objective)
        last, kept = new, improvement > KEPT_PROMISE * expected
        damping = max(damping * (AFTER_KEPT if kept else AFTER_LESS), MIN_DAMPING)
    return replace(last, converged=converged)


def _step(at: Solution, damping: float) -> tuple[float, float, Floats]:
    """What an undamped step promises and what a damped one does, and where that leads, (p,).

    A promise is the decrease of the linearised objective, up to the bounds.
    """
    problem, x = at.problem, at.x
    deviation, rates = problem.deviation(x), problem.rates(x)
    descent = at.residual @ at.jacobian - deviation @ rates
    normal, scale = _curvature(at)
    ends = problem.lower - x, problem.upper - x
    full, step = (
        bounded_step(normal + factor * scale, descent, *ends) for factor in (LEAST_DAMPING, damping)
    )
    promised, expected = (float(2.0 * descent @ s - s @ normal @ s) for s in (full, step))
    return promised, expected, np.clip(x + step, problem.lower, problem.upper)


def _corrected(last: Solution, new: Solution, damping: float) -> Floats:
    r"""Where a step led, corrected by what of the model is not linear, (p,).

    .. math:: (N + \lambda\, \mathrm{diag}(N))\, \Delta x = J^T (r - r_0 + J\, \delta x)

    with the residuals r there, and r_0 and J at the last point. That leads back to the floor of a
    curved valley, and no further along it.

    References: Transtrum and Sethna, arXiv:1201.5885, 2012 (geodesic acceleration).
    """
    problem, x = last.problem, new.x
    bent = new.residual - last.residual + last.jacobian @ (x - last.x)
    normal, scale = _curvature(last)
    ends = problem.lower - x, problem.upper - x
    step = bounded_step(normal + damping * scale, bent @ last.jacobian, *ends)
    return np.clip(x + step, problem.lower, problem.upper)


def _curvature(at: Solution) -> tuple[Floats, Floats]:
    """Half the curvature (p, p) of the linearised objective, and what damping adds to it."""
    rates = at.problem.rates(at.x)
    normal = at.jacobian.T @ at.jacobian + rates.T @ rates
    return normal, np.diag(np.diag(normal) + LEAST_SCALE)


def bounded_step(normal: Floats, descent: Floats, low: Floats, high: Floats) -> Floats:
    r"""The step (p,) that lowers a quadratic function between bounds.

    .. math:: \tfrac{1}{2}\, \Delta x^T N\, \Delta x - d^T \Delta x

    Whenever a coordinate meets a bound on the way to the minimum, it stays there, and the others
    go on to the minimum that belongs to it. To leave coordinates outside their bounds and move them
    back afterwards would leave the valley of a function whose minimum lies far outside.

    normal (p, p), descent (p,): N and d.
    low, high (p,): Bounds of the step, around zero.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 16.5 (active sets).
    """
    step = np.zeros_like(descent)
    free = ~(((low >= 0.0) & (descent < 0.0)) | ((high <= 0.0) & (descent > 0.0)))
    while free.any():
        left = (descent - normal[:, ~free] @ step[~free])[free]
        change = np.zeros_like(step)
        change[free] = np.linalg.solve(normal[np.ix_(free, free)], left) - step[free]
        end = np.where(change < 0.0, low, high)
        beyond = np.abs(change) > np.abs(end - step)
        if not beyond.any():
            return step + change
        share = np.where(beyond, (end - step) / np.where(beyond, change, 1.0), 1.0)
        first = int(np.argmin(share))
        step = step + share[first] * change
        step[first], free[first] = end[first], False
    return step
