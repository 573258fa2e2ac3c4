"""What designs do on a slope in many worlds: margin, slip, work, torque, sinkage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.physics.contact import Force
from soilml.physics.effects.grousers import Grousers
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.rover_design.study import DesignStudy
from soilml.rover_design.worlds import DrawnWorlds
from soilml.traction.vehicle import NeededSlip

#: Slips of a sweep and of a reported design, as shares of the slip limit.
SWEPT = np.asarray([0.12, 0.3, 0.55, 0.8, 1.0])
REPORTED = np.asarray([0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
#: Of a rover, each slip and lug is reckoned by the rim, as `Grousers.rim_slip` says.
RIM_SLIP = 1.0


@dataclass(frozen=True)
class Outcomes:
    """What k designs do on the slope of a study in n worlds, (k, n) each.

    margin: Largest pull up to the slip limit less the weight along the slope, N; minus infinity
        where the soil does not carry a wheel at any slip.
    slip, energy, torque, sinkage: Slip that the slope needs, work of the wheels for each metre
        (J/m), largest torque (N m) and sinkage (m) of a wheel there; NaN where it is not climbed.
    pull_error: What the errors of the model add to the largest pull, N.
    met: Whether the goal is met.
    """

    margin: Floats
    slip: Floats
    energy: Floats
    torque: Floats
    sinkage: Floats
    pull_error: Floats
    met: NDArray[np.bool_]


def evaluate(
    study: DesignStudy,
    designs: Mapping[str, Floats],
    worlds: DrawnWorlds,
    *,
    shares: Floats = REPORTED,
) -> Outcomes:
    r"""Outcomes of designs in worlds.

    .. math:: \sum_i DP_i(s, W_i) = m g \sin\alpha, \quad
        E = \sum_i \frac{T_i}{r (1 - s)}, \quad
        DP_i = DP(s, W_i) + W_i (e_1 + e_2 s) + \delta(s, W_i)

    The first, at the least slip s that all wheels share, gives the slip that the slope needs, as in
    `soilml.traction.vehicle`. The errors of the model e and delta are those of the world.

    designs: Values (k,) by dimension of the study.
    shares: Slips, as shares of the slip limit.

    Raises `InputError` where a wheel leaves the ground on the slope.

    References: Wong, Theory of Ground Vehicles, chapters 2 and 3.
    """
    count = len(designs["radius"])
    parts: list[tuple[NDArray[np.int64], Outcomes]] = []
    for wheels in np.unique(designs["wheels"]):
        own = np.flatnonzero(designs["wheels"] == wheels)
        values = {name: column[own] for name, column in designs.items()}
        parts.append((own, _of_equal_wheels(study, int(wheels), values, worlds, shares)))
    joined = {}
    for field in fields(Outcomes):
        one = getattr(parts[0][1], field.name)
        joined[field.name] = np.empty((count, worlds.count), one.dtype)
        for own, part in parts:
            joined[field.name][own] = getattr(part, field.name)
    return Outcomes(**joined)


def _of_equal_wheels(
    study: DesignStudy,
    wheels: int,
    designs: Mapping[str, Floats],
    worlds: DrawnWorlds,
    shares: Floats,
) -> Outcomes:
    """The outcomes of designs that have the same number of wheels."""
    goal, count = study.goal, len(designs["radius"])
    slip = goal.slip_limit * shares
    load = designs["mass"][:, None] * study.axle_loads(wheels, goal.slope)  # (k, axles)
    shape = (count, worlds.count, load.shape[1], len(slip))
    pull, torque, sinkage = (np.empty(shape) for _ in range(3))
    for draw in worlds.groups():
        force = _forces(designs, load, worlds, draw, slip)
        pull[:, draw] = force.drawbar_pull
        torque[:, draw] = force.torque
        sinkage[:, draw] = force.sinkage
    pull_error, torque = _with_errors(pull, torque, load, worlds, slip)
    total = 2.0 * (pull + pull_error).sum(axis=2)  # (k, n, m)
    needed = (designs["mass"] * study.gravity * np.sin(goal.slope))[:, None]
    known = np.nan_to_num(total, nan=-np.inf)
    best = np.argmax(known, axis=-1)[..., None]
    margin = np.take_along_axis(known, best, axis=-1)[..., 0] - needed
    error = 2.0 * np.take_along_axis(pull_error.sum(axis=2), best, axis=-1)[..., 0]
    at = NeededSlip.of(total, needed)
    radius = designs["radius"][:, None, None]
    work = 2.0 * torque.sum(axis=2) / (radius * (1.0 - slip))
    found_slip = at.of_curve(np.broadcast_to(slip, total.shape))
    found_sinkage = at.of_curve(sinkage.max(axis=2))
    energy, most_torque = at.of_curve(work), at.of_curve(torque.max(axis=2))
    met = (margin >= goal.margin) & (most_torque <= goal.torque_limit)
    met &= energy <= goal.energy_limit
    return Outcomes(
        margin, found_slip, energy, most_torque, found_sinkage, np.nan_to_num(error), met
    )


def _forces(
    designs: Mapping[str, Floats],
    load: Floats,
    worlds: DrawnWorlds,
    draw: NDArray[np.int64],
    slip: Floats,
) -> Force:
    """Forces (k, g, axles, m) of k designs in the g worlds of one group."""
    shape = (len(load), len(draw), load.shape[1], len(slip))
    design, world, axle, column = (grid.ravel() for grid in np.indices(shape))
    world = draw[world]
    effects = worlds.effects(world, load.mean(axis=1)[design])
    if np.any(designs["lug_height"] > 0.0):
        lugs = Grousers(
            height=designs["lug_height"][design],
            shearing=worlds.lug_shearing[world],
            rim_slip=RIM_SLIP,
        )
        effects.append(lugs)
    gear = Wheel(radius=designs["radius"][design], width=designs["width"][design])
    at = Operating(
        slip=slip[column], load=load[design, axle], pass_number=axle + 1.0, slip_angle=0.0
    )
    force = Model(gear, tuple(effects))(worlds.of_soil(world), at)
    return Force(**{f.name: np.reshape(getattr(force, f.name), shape) for f in fields(Force)})


def _with_errors(
    pull: Floats, torque: Floats, load: Floats, worlds: DrawnWorlds, slip: Floats
) -> tuple[Floats, Floats]:
    """Errors of the pull (k, n, axles, m), N, and the torque with its own."""
    errors, none = worlds.errors, np.zeros(worlds.count)
    offset, growth, gain = (
        errors.get(name, none)
        for name in ("drawbar_pull", "drawbar_pull_by_slip", "torque_by_slip")
    )
    share = offset[:, None] + growth[:, None] * slip  # (n, m)
    pull_error = load[:, None, :, None] * share[None, :, None, :]
    relative = load / load.mean(axis=1, keepdims=True)
    at_slip, at_load = np.broadcast_arrays(slip, relative[..., None])
    basis = worlds.smooth.at(at_slip.ravel(), at_load.ravel())
    basis = basis.reshape(*relative.shape, len(slip), -1)
    smooth = np.einsum("kamq,ncq->cknam", basis, worlds.weights)
    pull_error += _range_with_zero(pull) * smooth[0]
    torque = torque * (1.0 + (gain[:, None] * slip)[None, :, None, :])
    return pull_error, torque + _range_with_zero(torque) * smooth[1]


def _range_with_zero(values: Floats) -> Floats:
    """max(y, 0) - min(y, 0) along the slips, kept as an axis of length 1."""
    known = np.nan_to_num(values)
    high, low = known.max(axis=-1, keepdims=True), known.min(axis=-1, keepdims=True)
    return np.asarray(np.maximum(high, 0.0) - np.minimum(low, 0.0))
