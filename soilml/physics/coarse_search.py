"""A first estimate of the sinkage at equilibrium, from few points in single precision."""

from __future__ import annotations

import math
from dataclasses import dataclass

from soilml.arrays import Array, namespace
from soilml.physics.forces import load_at_sinkage
from soilml.physics.load_case import LoadCase, single_precision

#: Most evaluations of the load. The last step is not evaluated.
EVALUATIONS = 4
#: The search ends, from the second evaluation on, where the steps in log sinkage of all rows are
#: below this: the next ones are of the order of its square.
SMALL_STEP = 0.02
#: Rows whose last step in log sinkage is larger than this are not solved.
MAX_LAST_STEP = 0.3
#: Changes of log sinkage below this leave the slope as it is: rounding would spoil it.
MIN_CHANGE = 3e-3
#: The search starts below the largest sinkage by this much in log sinkage at least.
INITIAL_MARGIN = 0.1
#: Bounds of the slope of log load against log sinkage, and of a step.
SLOPES, MAX_STEP = (0.05, 20.0), 3.0


@dataclass(frozen=True)
class SinkageEstimate:
    """Where a search for equilibrium starts, arrays (batch,); NaN in rows that are not known.

    Where the load carried rises through the load more than once, the crossing next to the estimate
    need not be the first, at which a gear comes to rest. With `nearest` it is accepted, and rows
    that are not solved from the estimate are left so, as trials of a descent may whose result is
    solved again; without, it is checked, and such rows are solved, as in an ordinary search.
    """

    log_sinkage: Array  # ln(z / m)
    slope: Array  # d ln W / d ln z, of the load that the soil carries
    nearest: bool = False


def coarse_estimate(load_case: LoadCase) -> SinkageEstimate:
    """Sinkage by secant steps on few points, in single precision, to a few thousandths."""
    xp = namespace(load_case.at.load)
    single = single_precision(load_case)
    soil, at, gear = single.soil, single.at, single.gear
    largest = xp.log(gear.largest_sinkage() + 0.0 * at.load)
    x = xp.minimum(xp.log(gear.initial_sinkage(soil, at)), largest - INITIAL_MARGIN)
    slope = soil.n + 0.5 + 0.0 * at.load  # of a rigid wheel, load against sinkage
    log_load = xp.log(at.load)
    step = last_x = last_y = x
    for number in range(EVALUATIONS):
        y = xp.log(load_at_sinkage(single, xp.exp(x), coarse=True)) - log_load
        if number > 0:
            change = x - last_x
            secant = (y - last_y) / xp.where(change == 0, xp.ones_like(change), change)
            usable = (xp.abs(change) > MIN_CHANGE) & (secant > SLOPES[0]) & (secant < SLOPES[1])
            slope = xp.where(usable, secant, slope)
        last_x, last_y = x, y
        step = xp.clip(-y / slope, -MAX_STEP, MAX_STEP)
        x = xp.minimum(x + step, largest)
        if number > 0 and bool(xp.all(xp.abs(step) < SMALL_STEP)):
            break
    x = xp.where(xp.abs(step) < MAX_LAST_STEP, x, xp.full_like(x, math.nan))
    return SinkageEstimate(xp.astype(x, xp.float64), xp.astype(slope, xp.float64))
