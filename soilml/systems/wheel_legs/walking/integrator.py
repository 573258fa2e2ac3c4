"""One step of the hub's motion: implicit, for every case at once; and the explicit reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TypeAlias, TypeVar

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.walking.ground_reaction import Batch, Reaction, reaction

GRAVITY = 9.81
#: Speed below which the direction of motion fades, as a share of the leg end's: 1 mm/s.
FADING = 0.02
#: A step is found when the forces balance to this share of the weight.
BALANCED = 1e-6
MOST_NEWTON_STEPS, MOST_HALVINGS = 25, 8
#: Largest change of velocity that a Newton step may make, as a share of the leg end's.
LARGEST_CHANGE = 0.3
#: How often a step that is not found is cut in two, and one in which the hub falls or strikes.
MOST_CUTS, MOST_FINE_CUTS = 16, 5
#: Change of the hub's velocity that counts as a fall or a blow, as a share of the leg end's.
ABRUPT = 0.2

Cases = TypeVar("Cases", "Hub", "Drive", Reaction)


@dataclass(frozen=True)
class Hub:
    """Place (m) and velocity (m/s) of every hub, (cases,)."""

    x: Array
    z: Array
    vx: Array
    vz: Array


@dataclass(frozen=True)
class Drive:
    """What is the same at every step, (cases,)."""

    mass: Array  # kg
    pace: Array  # m/s, of the leg's end about the hub
    legs: Array
    slip: Array  # commanded; NaN where the wheel rolls freely
    fading: Array  # m/s, see `reaction`

    def target(self, angle: float) -> Array:
        """Horizontal velocity that the commanded slip asks for (eq. 11), m/s; NaN: none."""
        return (1.0 - self.slip) * self.pace * np.sin(nearest_attack(angle, self.legs))


def nearest_attack(angle: Array | float, legs: Array) -> Array:
    """Attack angle, rad, of the leg nearest to straight down; pi/2 where it hangs straight.

    `angle`: what the wheel has turned since a leg hung straight down.
    """
    pitch = 2.0 * np.pi / legs
    return 0.5 * np.pi + angle - pitch * np.round(angle / pitch)


#: (batch, drive, hub, angle at the start, at the end) -> hub then, reaction, whether it is found.
Step: TypeAlias = Callable[[Batch, Drive, Hub, float, float], tuple[Hub, Reaction, Array]]


def some(state: Cases, cases: Array) -> Cases:
    """Some of the cases of a record of arrays whose last axis is the cases."""
    return type(state)(**{f.name: getattr(state, f.name)[..., cases] for f in fields(state)})


def merged(state: Cases, part: Cases, cases: Array) -> Cases:
    """The record with `part` in place of those cases."""
    whole = {f.name: getattr(state, f.name).copy() for f in fields(state)}
    for name, array in whole.items():
        array[..., cases] = getattr(part, name)
    return type(state)(**whole)


def implicit(
    given: Batch, drive: Drive, hub: Hub, start: float, stop: float, cuts: int = 0
) -> tuple[Hub, Reaction, Array]:
    r"""Hub and ground at the end of the step, and whether the forces balance there, (cases,).

    .. math:: M (v' - v) / dt = F(v', z + v'_z dt) - M g

    by Newton steps in both velocities, each as long as lowers the imbalance. Cases for which that
    fails, or whose velocity changes abruptly, take the step in two halves: a fall is resolved. A
    commanded case takes its horizontal velocity as told.
    """
    moved, found, balanced = _solved(given, drive, hub, start, stop)
    abrupt = np.abs(moved.vz - hub.vz) > ABRUPT * drive.pace
    hard = np.flatnonzero(~balanced | (abrupt & (cuts < MOST_FINE_CUTS)))
    if hard.size and cuts < MOST_CUTS:
        middle, part, told = 0.5 * (start + stop), given.of(hard), some(drive, hard)
        half, _, first = implicit(part, told, some(hub, hard), start, middle, cuts + 1)
        balanced[hard] = False
        able, kept = hard[first], np.flatnonzero(first)
        if able.size:
            ahead = (part.of(kept), some(told, kept), some(half, kept))
            end, felt, balanced[able] = implicit(*ahead, middle, stop, cuts + 1)
            moved, found = merged(moved, end, able), merged(found, felt, able)
    return moved, found, balanced


def _solved(
    given: Batch, drive: Drive, hub: Hub, start: float, stop: float
) -> tuple[Hub, Reaction, Array]:
    pose, dt, target = given.at(stop), (stop - start) / given.speed, drive.target(stop)
    told = ~np.isnan(drive.slip)
    weight, inertia = drive.mass * GRAVITY, drive.mass / dt

    def imbalance(vx: Array, vz: Array) -> tuple[Array, Array, Array, Reaction]:
        found = reaction(given, pose, hub.z + vz * dt, vx, vz, drive.fading)
        rx = np.where(told, 0.0, inertia * (vx - hub.vx) - found.ahead)
        rz = inertia * (vz - hub.vz) - found.up + weight
        return rx, rz, np.hypot(rx, rz) / weight, found

    vx, vz = np.where(told, target, hub.vx), hub.vz
    rx, rz, size, found = imbalance(vx, vz)
    for _ in range(MOST_NEWTON_STEPS):
        if np.all(size < BALANCED):
            break
        dx, dz = _newton(found, rx, rz, inertia, dt, told)
        change = np.maximum(np.hypot(dx, dz), 1e-300)
        share = np.minimum(1.0, LARGEST_CHANGE * drive.pace / change)
        share = np.where(size < BALANCED, 0.0, share)
        for halving in range(MOST_HALVINGS):
            tried = imbalance(vx + share * dx, vz + share * dz)
            worse = ~(tried[2] < size) & (share > 0.0)
            if halving == MOST_HALVINGS - 1 or not np.any(worse):
                break
            share = np.where(worse, 0.5 * share, share)
        vx, vz = vx + share * dx, vz + share * dz
        rx, rz, size, found = tried
    return Hub(hub.x + vx * dt, hub.z + vz * dt, vx, vz), found, size < BALANCED


def _newton(
    found: Reaction, rx: Array, rz: Array, inertia: Array, dt: Array, told: Array
) -> tuple[Array, Array]:
    """The Newton step of both velocities, or of the vertical one where the other is commanded."""
    xx = inertia - found.slopes[0, 0]
    xz = -found.slopes[0, 1] - found.sinking[0] * dt
    zx = -found.slopes[1, 0]
    zz = inertia - found.slopes[1, 1] - found.sinking[1] * dt
    xx, xz, zx = (np.where(told, fixed, free) for fixed, free in ((1, xx), (0, xz), (0, zx)))
    determinant = xx * zz - xz * zx
    return (xz * rz - zz * rx) / determinant, (zx * rx - xx * rz) / determinant


def explicit(
    given: Batch, drive: Drive, hub: Hub, start: float, stop: float
) -> tuple[Hub, Reaction, Array]:
    """The paper's own step (eq. 8): velocities by the forces at its start; needs about 1e-4 s."""
    dt, told = (stop - start) / given.speed, ~np.isnan(drive.slip)
    found = reaction(given, given.at(start), hub.z, hub.vx, hub.vz, drive.fading)
    vx = np.where(told, drive.target(stop), hub.vx + found.ahead / drive.mass * dt)
    vz = hub.vz + (found.up / drive.mass - GRAVITY) * dt
    return Hub(hub.x + vx * dt, hub.z + vz * dt, vx, vz), found, np.isfinite(vz)
