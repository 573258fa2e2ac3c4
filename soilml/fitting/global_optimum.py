"""The lowest optimum of a least-squares problem, by descents from several starts."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.damped_descents import APART, descend
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import forces
from soilml.numerics.quantiles import latin_hypercube
from soilml.physics.operating_point import Operating
from soilml.row_status import Status

POINTS, SEED = 64, 7  # Points of the priors, by Latin hypercube, that may be starts
STARTS = 4  # How many of the best of them are descended from
#: Two descents that end this close, as fractions of the priors, found the same optimum.
SAME_OPTIMUM = 1e-4
#: Costs, in squared standard deviations, that differ by less count as equal: e^(-0.01) in
#: likelihood.
EQUAL_COST = 0.02


def global_optimum(problem: LeastSquaresProblem) -> Solution:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    nominal = np.asarray([c.prior.fraction(c.nominal) for c in problem.coordinates])
    soils = latin_hypercube(POINTS, len(nominal), np.random.default_rng(SEED))
    starts = np.vstack([nominal, soils])
    costs = (problem.whitened(problem.predict(starts)) ** 2).sum(axis=1)
    costs += (problem.soil_tests.deviation(starts) ** 2).sum(axis=1)
    order = np.argsort(costs, kind="stable").tolist()
    found: list[Solution] = []
    for i in dict.fromkeys([*order[:STARTS], 0]):  # the nominal point too
        found.append(descend(problem, starts[i], APART))
        if len(found) == 2 and np.abs(found[0].x - found[1].x).max() < SAME_OPTIMUM:
            break  # two descents that end at the same optimum are enough
    if not any(np.isfinite(o.prediction).all() for o in found) and not any(
        np.isfinite(problem.predict(start[None, :])).all() for start in starts
    ):
        raise_uncarried(problem.case, problem.readings.at)
    lowest = min(o.objective for o in found)
    equal = [o for o in found if o.objective <= lowest + EQUAL_COST]
    return min(equal, key=lambda optimum: float(np.sum((optimum.x - 0.5) ** 2)))


def raise_uncarried(case: Case, at: Operating) -> NoReturn:
    """Raise `FitError`, with the reason that the soil of the case has at the rows `at` (n,).

    For fits in which no soil of the priors has an equilibrium at all rows.
    """
    if missing := missing_peak(case, at):
        raise FitError(f"no soil in the prior has a stress profile in all rows: {missing}")
    raise FitError(
        "no parameters in the prior carry the measured loads: check load_N, kphi, n and [gear]"
    )


def missing_peak(case: Case, at: Operating) -> str:
    """The first of the rows `at` (n,) whose maximum stress is outside the contact; "" for none."""
    outside = np.flatnonzero(np.asarray(forces(case, at).status) == Status.NO_PEAK)
    if not outside.size:
        return ""
    slip = float(np.broadcast_to(at.slip, np.broadcast(at.slip, at.load).shape)[outside[0]])
    a0, a1 = float(case.soil.a0), float(case.soil.a1)
    return (
        f"a0 + a1 slip is {a0 + a1 * slip:.3g} at slip {slip:.3g}, and must be above 0 and below "
        "1; change a0 or a1 in [soil]"
    )
