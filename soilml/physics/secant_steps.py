"""Secant steps in log sinkage from a good estimate, and the forces between the last two."""

from __future__ import annotations

import math
from dataclasses import fields, replace

from soilml.arrays import Array, namespace
from soilml.physics.coarse_search import SinkageEstimate
from soilml.physics.contact import Force
from soilml.physics.forces import forces_at_sinkage
from soilml.physics.load_case import LoadCase, rows
from soilml.physics.merged_rows import merge_rows, merged_position
from soilml.row_status import Status

#: Evaluations after which a row is solved by the ordinary search instead.
MAX_EVALUATIONS = 6
#: A row is solved where the logarithm of the load carried over the load is below the first figure,
#: and its product with that of the evaluation before below the second: the error of the
#: interpolation between the two is of the order of the product.
MAX_LOG_RATIO, MAX_PRODUCT = 1e-5, 1e-11
#: A change of that logarithm below this is mostly rounding and gives no slope.
MIN_CHANGE = 1e-9
#: The estimate may be off by this much in log sinkage at most; larger steps leave its vicinity.
MAX_STEP = 2.0


def forces_near(load_case: LoadCase, estimate: SinkageEstimate) -> tuple[Force, Array]:
    """Forces at the equilibrium next to an estimate, and the slope of log load there; (batch,).

    Rows that are not solved are marked by their status.
    """
    xp = namespace(estimate.slope)
    first = forces_at_sinkage(load_case, xp.exp(estimate.log_sinkage))
    force, slope = _secant_steps(
        load_case, first, estimate.log_sinkage, estimate.slope, MAX_EVALUATIONS - 1
    )
    within = force.sinkage <= load_case.gear.largest_sinkage()
    unsolved = xp.full_like(force.status, int(Status.NOT_CONVERGED))
    return replace(force, status=xp.where(within, force.status, unsolved)), slope


def _secant_steps(
    load_case: LoadCase, last: Force, log_sinkage: Array, slope: Array, evaluations: int
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
    close = (xp.abs(new_log_ratio) < MAX_LOG_RATIO) & (secant > 0)
    close = close & (xp.abs(log_ratio * new_log_ratio) < MAX_PRODUCT)
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
        evaluations - 1,
    )
    slopes = xp.concat([secant, nearer_slope], axis=0)
    return merge_rows(force, ~go_on, nearer), xp.take(slopes, merged_position(~go_on), axis=0)
