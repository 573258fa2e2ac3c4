"""The equilibrium next to an estimate of the sinkage, from few evaluations."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np

from soilml.arrays import Array, namespace
from soilml.physics.contact import Force
from soilml.physics.effects.base import apply_stage
from soilml.physics.equilibrium import equilibrium_forces, without_unsolved
from soilml.physics.forces import apply_input_effects, forces_at_sinkage
from soilml.physics.load_case import LoadCase, rows
from soilml.physics.model import in_chunks
from soilml.physics.sinkage_search import SinkageEstimate, merge_rows
from soilml.row_status import Status

#: Evaluations after which a row is solved by the ordinary search instead.
MAX_EVALUATIONS = 4
#: A row is solved where the logarithm of the load carried over the load is below the first figure,
#: and its product with that of the evaluation before below the second: the error of the
#: interpolation between the two is of the order of the product.
MAX_LOG_RATIO, MAX_PRODUCT = 1e-5, 1e-9
#: A change of that logarithm below this is mostly rounding and gives no slope.
MIN_CHANGE = 1e-9
#: The estimate may be off by this much in log sinkage at most; larger steps leave its vicinity.
MAX_STEP = 1.0


def readings_near(load_case: LoadCase, estimate: SinkageEstimate) -> Force:
    """Sensor readings at the equilibrium next to an estimate of the sinkage, (batch,).

    Where the load carried rises through the load more than once this is the crossing next to the
    estimate, which need not be the first: trials of a descent, whose accepted points are solved by
    the ordinary search, need no more. Rows that secant steps from the estimate do not solve are
    solved by the ordinary search.

    Parameters
    ----------
    load_case : LoadCase
        Parameters of shape () or (batch,), from `soilml.physics.model.flattened`.
    """
    with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
        return in_chunks(load_case, _readings_near, estimate.log_sinkage, estimate.slope)


def _readings_near(load_case: LoadCase, log_sinkage: Array, slope: Array) -> Force:
    xp = namespace(log_sinkage)
    true_case = apply_input_effects(load_case)
    first = forces_at_sinkage(true_case, xp.exp(log_sinkage))
    force = _secant_steps(true_case, first, log_sinkage, slope, MAX_EVALUATIONS - 1)
    unsolved = xp.nonzero(force.status != 0)[0]
    if unsolved.shape[0]:
        searched = equilibrium_forces(rows(load_case, unsolved))
        force = merge_rows(force, force.status == 0, searched)
    return without_unsolved(apply_stage(load_case.effects, "on_reading", force, true_case))


def _secant_steps(
    true_case: LoadCase, last: Force, log_sinkage: Array, slope: Array, evaluations: int
) -> Force:
    """Forces at the root, interpolated between its last two estimates; unsolved rows by status."""
    xp, load = namespace(slope), true_case.at.load
    log_ratio = xp.log(last.load / load)
    step = -log_ratio / slope
    step = xp.where(xp.abs(step) < MAX_STEP, step, xp.full_like(step, math.nan))
    new = forces_at_sinkage(true_case, xp.exp(log_sinkage + step))
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
    others = xp.nonzero(~close)[0]
    if evaluations == 1 or not others.shape[0]:
        return force
    nearer = _secant_steps(
        rows(true_case, others),
        Force(**{f.name: getattr(new, f.name)[others] for f in fields(Force)}),
        (log_sinkage + step)[others],
        secant[others],
        evaluations - 1,
    )
    return merge_rows(force, close, nearer)
