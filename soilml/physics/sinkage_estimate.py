"""An estimate of the sinkage at equilibrium, and the equilibrium next to it.

`coarse_estimate` comes from few points of the contact in single precision. `forces_near` reaches
the equilibrium from that or another estimate by secant steps in log sinkage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from soilml.arrays import Array, namespace
from soilml.physics.contact import Force
from soilml.physics.forces import forces_at_sinkage, load_at_sinkage
from soilml.physics.load_case import LoadCase, coarse, merge_rows, merged_position, rows
from soilml.row_status import Status

COARSE_EVALUATIONS = 4  # Most evaluations of the load. The last step is not evaluated.
#: The search ends, from the second evaluation on, where the steps in log sinkage of all rows are
#: below this: the next ones are of the order of its square.
SMALL_STEP = 0.02
MAX_LAST_STEP = 0.3  # Rows whose last step in log sinkage is larger than this are not solved
#: Changes of log sinkage below this leave the slope as it is: rounding would spoil it.
COARSE_MIN_CHANGE = 3e-3
#: The search starts below the largest sinkage by this much in log sinkage at least.
INITIAL_MARGIN = 0.1
#: Bounds of the slope of log load against log sinkage, and of a step.
SLOPES, COARSE_MAX_STEP = (0.05, 20.0), 3.0

MAX_EVALUATIONS = 6  # Evaluations after which a row is solved by the ordinary search instead
#: A row is solved where the logarithm of the load carried over the load is below the first figure,
#: and its product with that of the evaluation before below the second: the error of the
#: interpolation between the two is of the order of the product. The others are those of searches
#: that are `rough` or `nearest`.
MAX_LOG_RATIO, MAX_PRODUCT = 1e-5, 1e-11
ROUGH_LOG_RATIO, ROUGH_PRODUCT = 1e-2, 1e-6
NEAREST_LOG_RATIO, NEAREST_PRODUCT = 3e-2, 1e-4
MIN_CHANGE = 1e-9  # A change of that logarithm below this is mostly rounding and gives no slope
#: The estimate may be off by this much in log sinkage at most; larger steps leave its vicinity.
MAX_STEP = 2.0


@dataclass(frozen=True)
class SinkageEstimate:
    """Where a search for equilibrium starts, arrays (batch,); NaN in rows that are not known.

    Where the load carried rises through the load more than once, the crossing next to the estimate
    need not be the first, at which a gear comes to rest. With `nearest` it is accepted, and rows
    that are not solved from the estimate stay so: trials of a descent, whose result is solved
    again, permit that. Without, the crossing is checked, and such rows are solved as in an ordinary
    search. With `rough`, what is found is accurate to about 1e-6, and with `nearest` alone to 1e-4.
    """

    log_sinkage: Array  # ln(z / m)
    slope: Array  # d ln W / d ln z, of the load that the soil carries
    nearest: bool = False
    rough: bool = False


def coarse_estimate(load_case: LoadCase) -> SinkageEstimate:
    """Sinkage by secant steps on few points, in single precision, to a few thousandths."""
    xp = namespace(load_case.at.load)
    few = coarse(load_case)
    soil, at, gear = few.soil, few.at, few.gear
    largest = xp.log(gear.largest_sinkage() + 0.0 * at.load)
    x = xp.minimum(xp.log(gear.initial_sinkage(soil, at)), largest - INITIAL_MARGIN)
    slope = soil.n + 0.5 + 0.0 * at.load  # of a rigid wheel, load against sinkage
    log_load = xp.log(at.load)
    step = last_x = last_y = x
    for number in range(COARSE_EVALUATIONS):
        y = xp.log(load_at_sinkage(few, xp.exp(x))) - log_load
        if number > 0:
            change = x - last_x
            secant = (y - last_y) / xp.where(change == 0, xp.ones_like(change), change)
            usable = (
                (xp.abs(change) > COARSE_MIN_CHANGE) & (secant > SLOPES[0]) & (secant < SLOPES[1])
            )
            slope = xp.where(usable, secant, slope)
        last_x, last_y = x, y
        step = xp.clip(-y / slope, -COARSE_MAX_STEP, COARSE_MAX_STEP)
        x = xp.minimum(x + step, largest)
        if number > 0 and bool(xp.all(xp.abs(step) < SMALL_STEP)):
            break
    x = xp.where(xp.abs(step) < MAX_LAST_STEP, x, xp.full_like(x, math.nan))
    return SinkageEstimate(xp.astype(x, xp.float64), xp.astype(slope, xp.float64))


def forces_near(load_case: LoadCase, estimate: SinkageEstimate) -> tuple[Force, Array]:
    """Forces at the equilibrium next to an estimate, and the slope of log load there; (batch,).

    Rows that are not solved are marked by their status.
    """
    xp = namespace(estimate.slope)
    first = forces_at_sinkage(load_case, xp.exp(estimate.log_sinkage))
    limits = (MAX_LOG_RATIO, MAX_PRODUCT)
    if estimate.rough:
        limits = (ROUGH_LOG_RATIO, ROUGH_PRODUCT)
    elif estimate.nearest:
        limits = (NEAREST_LOG_RATIO, NEAREST_PRODUCT)
    force, slope = _secant_steps(
        load_case, first, estimate.log_sinkage, estimate.slope, limits, MAX_EVALUATIONS - 1
    )
    within = force.sinkage <= load_case.gear.largest_sinkage()
    unsolved = xp.full_like(force.status, int(Status.NOT_CONVERGED))
    return replace(force, status=xp.where(within, force.status, unsolved)), slope


def _secant_steps(
    load_case: LoadCase,
    last: Force,
    log_sinkage: Array,
    slope: Array,
    limits: tuple[float, float],
    evaluations: int,
) -> tuple[Force, Array]:
    """Forces at the root, interpolated between its last two estimates, and the slope there.

    Rows that are not solved are marked by their status.
    """
    xp, load = namespace(slope), load_case.at.load
    log_ratio = xp.log(last.load / load)
    step = -log_ratio / slope
    step = xp.where(xp.abs(step) < MAX_STEP, step, xp.full_like(step, math.nan))
    new = forces_at_sinkage(load_case, xp.exp(log_sinkage + step))
    new_log_ratio = xp.log(new.load / load)
    change = new_log_ratio - log_ratio
    resolved = xp.abs(change) > MIN_CHANGE
    secant = xp.where(resolved, change / step, slope)
    # from the last estimate to the root, in steps between the two
    fraction = xp.where(resolved, -log_ratio / change, xp.ones_like(change))
    close = (xp.abs(new_log_ratio) < limits[0]) & (secant > 0)
    close = close & (xp.abs(log_ratio * new_log_ratio) < limits[1])
    parts: dict[str, Array] = {
        name: getattr(last, name) + fraction * (getattr(new, name) - getattr(last, name))
        for name in ("torque", "drawbar_pull", "sinkage", "entry_angle")
    }
    unsolved = xp.full_like(new.status, int(Status.NOT_CONVERGED))
    status = xp.where(close, new.status, unsolved)
    force = Force(load=load + 0.0 * change, status=status, **parts)
    # a row whose log ratio is not finite stays so: its next step is not defined
    go_on = ~close & xp.isfinite(new_log_ratio)
    others = xp.nonzero(go_on)[0]
    if evaluations == 1 or not others.shape[0]:
        return force, secant
    nearer, nearer_slope = _secant_steps(
        rows(load_case, others),
        Force(**{f.name: getattr(new, f.name)[others] for f in fields(Force)}),
        (log_sinkage + step)[others],
        secant[others],
        limits,
        evaluations - 1,
    )
    slopes = xp.concat([secant, nearer_slope], axis=0)
    return merge_rows(force, ~go_on, nearer), xp.take(slopes, merged_position(~go_on), axis=0)
