"""Descents by scipy from several starts, which `identify` takes: the lowest optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import MissingLibraryError
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation
from soilml.fitting.uncarried_loads import raise_uncarried
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.quantiles import latin_hypercube

POINTS, SEED = 64, 7  # Points of the priors, by Latin hypercube, that may be starts
STARTS = 4  # How many of the best of them are descended from
#: Tolerance of a descent; and of those from several starts, which only tell optima apart.
TOLERANCE, START_TOLERANCE = 1e-10, 1e-5
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02


def global_optimum(problem: LeastSquaresProblem) -> Solution:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    starts, order = _ranked_starts(problem)
    found: list[Solution] = []
    for i in dict.fromkeys([*order[:STARTS], 0]):  # the nominal point too
        optimum = descend(problem, starts[i], tolerance=START_TOLERANCE)
        found.append(optimum)
        if len(found) == 2 and np.abs(found[0].x - optimum.x).max() < SAME_OPTIMUM:
            break  # two descents that end at the same optimum are enough
    if not any(np.isfinite(o.prediction).all() for o in found) and not any(
        np.isfinite(problem.predict(start[None, :])).all() for start in starts
    ):
        raise_uncarried(problem.case, problem.readings.at)
    lowest = min(o.cost_with_priors for o in found)
    equal = [o for o in found if o.cost_with_priors <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.x - 0.5) ** 2)))


def _ranked_starts(problem: LeastSquaresProblem) -> tuple[Floats, list[int]]:
    """Points (n, p) of the prior, the nominal one first, and their order by rising cost."""
    nominal = np.asarray([c.prior.fraction(c.nominal) for c in problem.coordinates])
    soils = latin_hypercube(POINTS, len(nominal), np.random.default_rng(SEED))
    starts = np.vstack([nominal, soils])
    costs = (problem.whitened(problem.predict(starts)) ** 2).sum(axis=1)
    costs += (problem.soil_tests.deviation(starts) ** 2).sum(axis=1)
    return starts, [int(i) for i in np.argsort(costs, kind="stable")]


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    *,
    with_prior: bool = False,
    tolerance: float = TOLERANCE,
    near: Linearisation | None = None,
) -> Solution:
    """The local optimum from a start, with normal priors and tests of the soil.

    It ends where cost, step and gradient change by less than the tolerance, relative.
    A linearisation `near` the start saves the search for equilibrium there.

    With `with_prior`, uniform priors are included too, as Gaussian ones of the same variance about
    their middle.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise MissingLibraryError("identify needs scipy: pip install '.[ground]'") from None

    # scipy asks for residual and Jacobian apart, and a rejected step returns to the point before
    latest: dict[bytes, Solution] = {}

    def linearised(x: Floats) -> Solution:
        key = x.tobytes()
        if key not in latest:
            before = next(reversed(latest.values())).linearisation if latest else near
            latest[key] = problem.linearised(x.copy(), before)
            while len(latest) > 2:
                del latest[next(iter(latest))]
        return latest[key]

    uniform = np.isinf(problem.normal_std)
    uniform_root = np.where(uniform, np.sqrt(UNIFORM_PRECISION if with_prior else 0.0), 0.0)

    def prior(x: Floats) -> tuple[Floats, Floats]:
        """Deviations (p,) from the priors in standard deviations, and their derivatives (p,)."""
        z, rate = problem.normal_deviation(x)
        return z + uniform_root * (x - 0.5), rate + uniform_root

    tests = problem.soil_tests
    found = least_squares(
        lambda x: np.concatenate([-linearised(x).residual, prior(x)[0], tests.deviation(x)]),
        np.clip(start, 1e-6, 1.0 - 1e-6),
        jac=lambda x: np.vstack([linearised(x).jacobian, np.diag(prior(x)[1]), tests.rates(x)]),
        bounds=(0.0, 1.0),
        ftol=tolerance,
        xtol=10.0 * tolerance,
        gtol=tolerance,
    )
    return replace(linearised(found.x), converged=bool(found.status > 0))
