"""One step of the hub's motion: implicit, for every case at once; and the explicit reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np

from soilml.arrays import Array
from soilml.wheel_legs.reaction import Batch, Pose, Reaction, reaction

GRAVITY = 9.81
#: Speed below which the direction of motion fades, m/s; a leg's end turns at 0.054 m/s.
FADING = 0.001
MOST_NEWTON_STEPS = 50
#: A step is found when the forces balance to this share of the weight.
BALANCED = 1e-6
#: Largest change of velocity that a Newton step may make, as a share of the speed of the leg's end.
LARGEST_CHANGE = 0.3


@dataclass(frozen=True)
class Hub:
    """Place (m) and velocity (m/s) of every hub, (cases,)."""

    x: Array
    z: Array
    vx: Array
    vz: Array

    def where(self, chosen: Array, other: Hub) -> Hub:
        """This hub in the chosen cases, the other one elsewhere."""
        names = [f.name for f in fields(Hub)]
        return Hub(*(np.where(chosen, getattr(self, n), getattr(other, n)) for n in names))


@dataclass(frozen=True)
class Drive:
    """What is the same at every step, (cases,)."""

    mass: Array  # kg
    pace: Array  # m/s, of the leg's end about the hub
    slip: Array  # commanded; NaN where the wheel rolls freely
    fading: float  # m/s, see `reaction`

    @property
    def commanded(self) -> Array:
        """Cases whose slip is commanded."""
        return ~np.isnan(self.slip)


#: (batch, pose, hub, drive, target, dt) -> hub at the end, ground's reaction, whether it is found.
Step: TypeAlias = Callable[[Batch, Pose, Hub, Drive, Array, Array], tuple[Hub, Reaction, Array]]


def implicit(
    given: Batch, pose: Pose, hub: Hub, drive: Drive, target: Array, dt: Array
) -> tuple[Hub, Reaction, Array]:
    r"""Hub and ground at the end of the step, and whether the forces balance there, (cases,).

    .. math:: M (v' - v) / dt = F(v', z + v'_z dt) - M g

    by Newton steps in both velocities, each as long as lowers the imbalance. A commanded case
    takes `target`, m/s, for its horizontal velocity.
    """
    mass, weight = drive.mass, drive.mass * GRAVITY
    vx, vz = np.where(drive.commanded, target, hub.vx), hub.vz

    def imbalance(vx: Array, vz: Array) -> tuple[Array, Array, Array, Reaction]:
        found = reaction(given, pose, hub.z + vz * dt, vx, vz, drive.fading)
        rx = mass * (vx - hub.vx) / dt - found.ahead
        rz = mass * (vz - hub.vz) / dt - found.up + weight
        rx = np.where(drive.commanded, 0.0, rx)
        return rx, rz, np.hypot(rx, rz) / weight, found

    rx, rz, size, found = imbalance(vx, vz)
    for _ in range(MOST_NEWTON_STEPS):
        if np.all(size < BALANCED):
            break
        dx, dz = _newton(found, rx, rz, mass / dt, dt, drive.commanded)
        change = np.hypot(dx, dz)
        share = np.minimum(1.0, LARGEST_CHANGE * drive.pace / np.maximum(change, 1e-300))
        share = np.where(size < BALANCED, 0.0, share)
        for halving in range(12):
            tried = imbalance(vx + share * dx, vz + share * dz)
            worse = ~(tried[2] < size * (1.0 - 1e-4 * share)) & (share > 0.0)
            if halving == 11 or not np.any(worse):
                break
            share = np.where(worse, 0.5 * share, share)
        vx, vz = vx + share * dx, vz + share * dz
        rx, rz, size, found = tried
    moved = Hub(hub.x + vx * dt, hub.z + vz * dt, vx, vz)
    return moved, found, size < BALANCED


def _newton(
    found: Reaction, rx: Array, rz: Array, inertia: Array, dt: Array, commanded: Array
) -> tuple[Array, Array]:
    """The Newton step of both velocities, or of the vertical one where the other is commanded."""
    xx = inertia - found.slopes[0, 0]
    xz = -found.slopes[0, 1] - found.sinking[0] * dt
    zx = -found.slopes[1, 0]
    zz = inertia - found.slopes[1, 1] - found.sinking[1] * dt
    xx, xz, zx = (np.where(commanded, held, free) for held, free in ((1, xx), (0, xz), (0, zx)))
    determinant = xx * zz - xz * zx
    return (xz * rz - zz * rx) / determinant, (zx * rx - xx * rz) / determinant


def explicit(
    given: Batch, pose: Pose, hub: Hub, drive: Drive, target: Array, dt: Array
) -> tuple[Hub, Reaction, Array]:
    """The paper's own step (eq. 8): velocities by the forces at its start; needs about 1e-4 s."""
    found = reaction(given, pose, hub.z, hub.vx, hub.vz, drive.fading)
    vx = np.where(drive.commanded, target, hub.vx + found.ahead / drive.mass * dt)
    vz = hub.vz + (found.up / drive.mass - GRAVITY) * dt
    return Hub(hub.x + vx * dt, hub.z + vz * dt, vx, vz), found, np.isfinite(vz)
