"""The sinkage at which the soil carries the load, for one flat batch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

from soilml.arrays import Array, namespace, tracked, untracked
from soilml.numerics.root_finding import crossing, scan
from soilml.parameters import values
from soilml.physics.contact import Force, Stress, integrate, stress
from soilml.physics.effects.base import apply_stage
from soilml.physics.load_case import LoadCase, rows
from soilml.row_status import Status

#: The soil carries the load within this share of it, or the row is not converged.
BALANCE = 1e-7
#: A row that was not solved directly is looked at at this many sinkages.
SCAN_POINTS = 32
#: Shear that pulls the wheel down by less than this share of the load cannot hide an earlier rest.
SMALL = 0.2
#: Where it does more, the row is looked at at this many sinkages, up to this share of that found,
#: and searched where the soil nearly carries the load there, or where the load carried rises with
#: less than this power of sinkage about the one found, and a peak may lie close.
LOOKS, DEEPEST_LOOK, NEARLY, GENTLE = 12, 0.9, 0.95, 0.4
#: The search begins at this share of the deepest sinkage.
SHALLOWEST = 1e-14


def loaded(load_case: LoadCase, sinkage: Array, *, rough: bool = False) -> Force:
    """Forces on a gear that stands this deep (m) in the soil, whatever load that carries."""
    xp = namespace(sinkage)
    soil = load_case.soil
    shape, stresses = stressed(load_case, sinkage, rough=rough)
    load, pull, torque = integrate(stresses)
    flaw = load_case.gear.flaw(shape)
    bearing = soil.kc / stresses.contact.width + soil.kphi + 0.0 * load
    status = xp.where((flaw == 0) & ~(bearing > 0), flaw + int(Status.NO_BEARING), flaw)
    force = Force(
        load=load,
        torque=torque,
        drawbar_pull=pull,
        sinkage=sinkage,
        entry_angle=shape.entry,
        status=status,
    )
    return apply_stage(load_case.effects, "on_force", force, load_case)


def stressed(load_case: LoadCase, sinkage: Array, *, rough: bool = False) -> tuple[Any, Stress]:
    """The gear's shape this deep (m) in the soil, and the stresses on it."""
    gear, soil, at, effects = load_case.gear, load_case.soil, load_case.at, load_case.effects
    shape = apply_stage(effects, "on_contact", gear.shape(sinkage, soil, at), load_case)
    contact = gear.rough(shape, at) if rough else gear.contact(shape, at)
    return shape, apply_stage(effects, "on_stress", stress(contact, soil, at), load_case)


def settled(load_case: LoadCase) -> Force:
    """What the sensors report of a gear at rest in the soil; arrays (batch,)."""
    force = at_rest(load_case)
    return _blanked(apply_stage(load_case.effects, "on_reading", force, prepared(load_case)))


def at_rest(load_case: LoadCase) -> Force:
    """Forces at the first sinkage at which the soil carries the load; arrays (batch,)."""
    load_case = prepared(load_case)
    leaves = list(values(load_case).values())
    with untracked(leaves):
        force = _carried(load_case)
    if tracked(leaves):
        force = _differentiable(load_case, force)
    return _blanked(force)


def prepared(load_case: LoadCase) -> LoadCase:
    """The load_case as it truly is: slip and load without sensor errors, the soil as it is met."""
    load_case = replace(
        load_case, at=apply_stage(load_case.effects, "on_operating", load_case.at, load_case)
    )
    return replace(
        load_case, soil=apply_stage(load_case.effects, "on_soil", load_case.soil, load_case)
    )


def stresses_along(load_case: LoadCase, sinkage: Array, points: int) -> tuple[Array, Stress]:
    """Angles and stresses (points, batch) on a gear that stands this deep (m) in the soil."""
    load_case = prepared(load_case)
    shape = apply_stage(
        load_case.effects,
        "on_contact",
        load_case.gear.shape(sinkage, load_case.soil, load_case.at),
        load_case,
    )
    angle, contact = load_case.gear.stations(shape, load_case.at, points)
    found = stress(contact, load_case.soil, load_case.at)
    return angle, apply_stage(load_case.effects, "on_stress", found, load_case)


def _carried(load_case: LoadCase) -> Force:
    """Forces at equilibrium, of every row: directly where that works, by search where not."""
    xp = namespace(load_case.at.load)
    soil, at, gear = load_case.soil, load_case.at, load_case.gear
    deepest = xp.log(gear.deepest() + 0.0 * at.load)
    guess = xp.log(gear.guess(soil, at))
    guess = xp.where(guess < deepest - 0.1, guess, deepest - 0.1)
    found, force, slope = _balanced(
        load_case, deepest + math.log(SHALLOWEST), deepest, guess, soil.n + 0.5 + 0.0 * at.load
    )
    found = found & ~_reached_before(load_case, force, slope)
    if not bool(xp.all(found)):
        index = xp.nonzero(~found)[0]
        force = _with_rows(force, found, _searched(rows(load_case, index)))
    return force


def _reached_before(load_case: LoadCase, force: Force, slope: Array) -> Array:
    """Rows that may carry the load at a smaller sinkage already, as a few points tell.

    A driving wheel's shear lifts it everywhere in front of the axle, and its load only rises. A
    braking wheel's pulls it down, and so does a driving wheel's behind the axle: without it the
    load would be reached earlier, but hardly so where it is small.
    """
    xp = namespace(slope)
    if not load_case.effects and not bool(xp.any(load_case.at.slip < 0)):
        return xp.zeros_like(slope, dtype=xp.bool)
    _, stresses = stressed(load_case, force.sinkage, rough=True)
    lift = stresses.shear * stresses.contact.ahead
    down = xp.sum(xp.maximum(-lift, xp.zeros_like(lift)), axis=0)
    doubted = down > SMALL * load_case.at.load
    if any(effect.overrides("on_stress") for effect in load_case.effects):
        doubted = xp.ones_like(doubted)
    if any(effect.overrides("on_force") for effect in load_case.effects):
        own = integrate(stresses)[0]
        doubted = doubted | (loaded(load_case, force.sinkage, rough=True).load != own)
    index = xp.nonzero(doubted)[0]
    if index.shape[0] == 0:
        return slope < GENTLE
    shares = [DEEPEST_LOOK * ((i + 1) / LOOKS) ** 2 for i in range(LOOKS)]
    sinkage = xp.concat([force.sinkage[index] * share for share in shares], axis=0)
    look = loaded(rows(load_case, xp.concat([index] * LOOKS, axis=0)), sinkage, rough=True)
    most = xp.max(xp.reshape(look.load, (LOOKS, index.shape[0])), axis=0)
    place = xp.clip(xp.cumulative_sum(xp.astype(doubted, xp.int64)) - 1, 0, None)
    reached = (
        xp.take(xp.concat([most, xp.zeros_like(slope[:1])]), place) > NEARLY * load_case.at.load
    )
    return (slope < GENTLE) | (doubted & reached)


def _differentiable(load_case: LoadCase, force: Force) -> Force:
    r"""The same forces, with their gradients through the equilibrium.

    .. math:: z(p) = z^* - \frac{W(z^*; p) - W}{\partial W / \partial z}

    One Newton step from the sinkage found, whose value is nil and whose derivative is that of the
    implicit function theorem. Rows without equilibrium have none.
    """
    xp = namespace(force.sinkage)
    with untracked(values(load_case).values()):
        z, h = force.sinkage, 1e-5
        above, below = loaded(load_case, z * (1.0 + h)).load, loaded(load_case, z * (1.0 - h)).load
        steepness = (above - below) / (2.0 * h * z)
    excess = loaded(load_case, z).load - load_case.at.load
    answered = force.status == 0
    step = xp.where(answered, excess / steepness, xp.zeros_like(z))
    return replace(loaded(load_case, z - step), status=force.status)


def _balanced(
    load_case: LoadCase, low: Array, high: Array, guess: Array, steepness: Array
) -> tuple[Array, Force, Array]:
    """Which rows have an equilibrium between two logs of sinkage, the forces, the slope there."""
    xp = namespace(guess)
    excess = _excess(load_case)
    root = crossing(excess, low, high, guess, steepness)
    force = loaded(load_case, xp.exp(root.x))
    balanced = xp.abs(force.load / load_case.at.load - 1.0) < BALANCE
    return root.found & balanced & (root.slope > 0), force, root.slope


def _excess(load_case: LoadCase) -> Callable[[Array], Array]:
    """Log of the load carried over the load, by log of sinkage; flat where far too little is."""
    xp = namespace(load_case.at.load)

    def excess(log_sinkage: Array) -> Array:
        ratio = loaded(load_case, xp.exp(log_sinkage)).load / load_case.at.load
        return xp.log(xp.maximum(ratio, xp.full_like(ratio, 1e-3)))

    return excess


def _searched(load_case: LoadCase) -> Force:
    """Rows where the load is not reached directly, or is reached on the way down from a peak.

    Under a braking wheel, or with an effect that lifts or unloads, the load carried need not rise
    with sinkage: the wheel comes to rest where it first reaches the load.
    """
    xp = namespace(load_case.at.load)
    deepest = xp.log(load_case.gear.deepest() + 0.0 * load_case.at.load)
    excess = _excess(load_case)
    steps = [3.0 * math.log((i + 1) / SCAN_POINTS) for i in range(SCAN_POINTS)]
    grid = xp.stack([deepest + step for step in [math.log(SHALLOWEST), *steps]], axis=0)
    low, high, exists, peak = scan(excess, grid)
    for _ in range(2):  # closer to a peak below the load, or within the interval found
        last = grid.shape[0] - 1
        left = xp.take_along_axis(grid, xp.clip(peak - 1, 0, last)[None, :], axis=0)[0, :]
        right = xp.take_along_axis(grid, xp.clip(peak + 1, 0, last)[None, :], axis=0)[0, :]
        grid = xp.stack([left + (right - left) * i / 16 for i in range(17)], axis=0)
        low_near, high_near, near, peak = scan(excess, grid)
        first = near & (~exists | (low_near < high))
        low, high = xp.where(first, low_near, low), xp.where(first, high_near, high)
        exists = exists | near
    top = xp.take_along_axis(grid, peak[None, :], axis=0)[0, :]
    low, high = xp.where(exists, low, top - 1e-3), xp.where(exists, high, top)
    found, force, _ = _balanced(load_case, low, high, 0.5 * (low + high), 1.0 / (high - low))
    at_top = loaded(load_case, xp.exp(top))
    status = xp.where(exists, int(Status.NOT_CONVERGED) + 0 * force.status, force.status)
    status = xp.where(exists, status, int(Status.TOO_HEAVY) + 0 * force.status)
    status = xp.where(force.status != 0, force.status, xp.where(found, 0 * status, status))
    return replace(force, status=status, load=xp.where(exists, force.load, at_top.load))


def _with_rows(force: Force, keep: Array, others: Force) -> Force:
    """`force` where `keep`, and the rows of `others`, in order, elsewhere."""
    xp = namespace(force.load)
    size = keep.shape[0]
    position = xp.where(
        keep,
        xp.arange(size, device=keep.device),
        size - 1 + xp.cumulative_sum(xp.astype(~keep, xp.int64)),
    )
    joined = {}
    for field in fields(Force):
        both = xp.concat([getattr(force, field.name), getattr(others, field.name)], axis=0)
        joined[field.name] = xp.take(both, position, axis=0)
    return Force(**joined)


def _blanked(force: Force) -> Force:
    """NaN for every answer of a row that has none."""
    xp = namespace(force.load)
    answered = force.status == 0
    nan = xp.full_like(force.load, math.nan)
    return replace(
        force,
        torque=xp.where(answered, force.torque, nan),
        drawbar_pull=xp.where(answered, force.drawbar_pull, nan),
        sinkage=xp.where(answered, force.sinkage, nan),
        entry_angle=xp.where(answered, force.entry_angle, nan),
    )
