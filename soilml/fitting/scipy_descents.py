"""Descents by scipy from several starts, which `identify` takes: the lowest optimum."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import MissingLibraryError
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation
from soilml.fitting.uncarried_loads import raise_uncarried
from soilml.numerics.prior import UNIFORM_PRECISION

#: Points of the table of Sobol points, and the most dimensions that it has.
POINTS, MOST_DIMENSIONS = 64, 8
SEED, BITS = 7, 30  # Seed of their scrambling, and bits of a coordinate
STARTS = 4  # How many of the best of the Sobol points of the prior are descended from
#: Tolerance of a descent; and of those from several starts, which only tell optima apart.
TOLERANCE, START_TOLERANCE = 1e-10, 1e-5
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
NEARLY_SAME = 3e-2  # A descent that comes this close to an optimum of equal cost ends there
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02


def global_optimum(problem: LeastSquaresProblem, few: LeastSquaresProblem) -> Solution:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior.

    Descents start without errors that all rows share. `few` is the problem of a few rows, which
    tell good starts from bad ones.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    starts, order = _ranked_starts(few)
    found: list[Solution] = []
    for i in dict.fromkeys([*order[:STARTS], 0]):  # the nominal point too
        # two descents that end at the same optimum are enough
        known = found[0] if len(found) == 1 else None
        optimum = descend(problem, starts[i], tolerance=START_TOLERANCE, known=known)
        if known is not None and np.abs(known.x - optimum.x).max() < SAME_OPTIMUM:
            break
        found.append(optimum)
    if not any(np.isfinite(o.prediction).all() for o in found) and not any(
        np.isfinite(problem.predict(start[None, :])).all() for start in starts
    ):
        raise_uncarried(problem.case, problem.readings.at)
    lowest = min(o.cost_with_priors for o in found)
    equal = [o for o in found if o.cost_with_priors <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.x - 0.5) ** 2)))


def _ranked_starts(problem: LeastSquaresProblem) -> tuple[Floats, list[int]]:
    """Points (n, p) of the prior, the nominal one first, and their order by rising cost."""
    coordinates = problem.coordinates
    errors = sum(c.normal_std is not None for c in coordinates)
    nominal = np.asarray([c.prior.fraction(c.nominal) for c in coordinates])
    soils = sobol_points(len(coordinates) - errors)
    starts = np.vstack([nominal, np.hstack([soils, np.full((len(soils), errors), 0.5)])])
    costs = (problem.whitened(problem.predict(starts)) ** 2).sum(axis=1)
    costs += (problem.soil_tests.deviation(starts) ** 2).sum(axis=1)
    return starts, [int(i) for i in np.argsort(costs, kind="stable")]


def sobol_points(dimensions: int) -> NDArray[np.float64]:
    """The first `POINTS` points (64, dimensions) of a scrambled Sobol sequence in [0, 1).

    They are those of ``scipy.stats.qmc.Sobol(dimensions, scramble=True, rng=7)``, which computes
    them where there are more than eight dimensions. The table `sobol_points.npy` has their integer
    coordinates (36, 64): one row for the only dimension, then two rows, and so on.
    """
    if dimensions > MOST_DIMENSIONS:
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(dimensions, scramble=True, rng=SEED).random(POINTS))
    table = resources.files("soilml.fitting").joinpath("sobol_points.npy")
    with table.open("rb") as opened:
        integers = np.load(opened, allow_pickle=False)
    first = dimensions * (dimensions - 1) // 2
    return np.asarray(integers[first : first + dimensions].T * 2.0**-BITS)


def descend(
    problem: LeastSquaresProblem,
    start: Floats,
    *,
    with_prior: bool = False,
    tolerance: float = TOLERANCE,
    known: Solution | None = None,
    near: Linearisation | None = None,
) -> Solution:
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
            if known is not None and _leads_to(known, latest[key]):
                raise _SameOptimumError(known)
        return latest[key]

    uniform = np.isinf(problem.normal_std)
    uniform_root = np.where(uniform, np.sqrt(UNIFORM_PRECISION if with_prior else 0.0), 0.0)

    def prior(x: Floats) -> tuple[Floats, Floats]:
        """Deviations (p,) from the priors in standard deviations, and their derivatives (p,)."""
        z, rate = problem.normal_deviation(x)
        return z + uniform_root * (x - 0.5), rate + uniform_root

    tests = problem.soil_tests
    try:
        found = least_squares(
            lambda x: np.concatenate([-linearised(x).residual, prior(x)[0], tests.deviation(x)]),
            np.clip(start, 1e-6, 1.0 - 1e-6),
            jac=lambda x: np.vstack([linearised(x).jacobian, np.diag(prior(x)[1]), tests.rates(x)]),
            bounds=(0.0, 1.0),
            ftol=tolerance,
            xtol=10.0 * tolerance,
            gtol=tolerance,
        )
    except _SameOptimumError as same:
        return same.optimum
    return replace(linearised(found.x), converged=bool(found.status > 0))


class _SameOptimumError(Exception):
    """A descent has come close to an optimum that is known."""

    def __init__(self, optimum: Solution) -> None:
        super().__init__()
        self.optimum = optimum


def _leads_to(known: Solution, trial: Solution) -> bool:
    """Whether a descent at a trial ends at a known optimum.

    It does where it is close, and the cost is the known optimum's quadratic; fewer readings than
    parameters leave a valley of equal cost, whose points count as different.
    """
    distance = trial.x - known.x
    if np.abs(distance).max() > NEARLY_SAME or len(trial.residual) < len(trial.x):
        return False
    quadratic = float(np.sum((known.jacobian @ distance) ** 2))
    return abs(trial.cost_with_priors - known.cost_with_priors - quadratic) < EQUAL_COST
