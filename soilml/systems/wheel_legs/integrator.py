"""Motion of the hub over time, all walks at once: implicit steps, and the status of each walk.

An explicit step is the reference in the tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import TypeAlias, TypeVar

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.ground_reaction import GroundReaction, PlateBatch, ground_reaction

GRAVITY = 9.81
#: Speed below which the direction of motion is regularised, as a fraction of the speed of the leg's
#: end: 1 mm/s for the paper's wheel-leg.
FADING = 0.02
TOLERANCE = 1e-6  # A step has converged when the forces balance to this fraction of the weight
#: Newton iterations of a step, and halvings of one Newton update that does not reduce the
#: imbalance.
MAX_NEWTON_STEPS, MAX_HALVINGS = 25, 8
#: Largest change of velocity by a Newton update, as a fraction of the speed of the leg's end: the
#: force is a function of the direction of motion and nearly singular at rest.
MAX_UPDATE = 0.3
#: How often a step that does not converge is halved, and a step with an abrupt change of velocity.
MAX_BISECTIONS, MAX_ABRUPT_BISECTIONS = 16, 5
#: Change of the vertical velocity that counts as abrupt (a fall or an impact), as a fraction of the
#: speed of the leg's end.
ABRUPT_CHANGE = 0.2

Cases = TypeVar("Cases", "HubState", "DriveParameters", GroundReaction)


@dataclass(frozen=True)
class HubState:
    """Position (m) and velocity (m/s) of every hub, (cases,)."""

    x: Array
    z: Array
    vx: Array
    vz: Array


@dataclass(frozen=True)
class DriveParameters:
    """Parameters that are constant over a walk, (cases,)."""

    mass: Array  # kg
    tip_speed: Array  # m/s, of the leg's end about the hub
    legs: Array
    slip: Array  # commanded; NaN where the wheel rolls freely
    fading: Array  # m/s, see `ground_reaction`

    def target_velocity(self, angle: float) -> Array:
        """Horizontal velocity at the commanded slip (eq. 11), m/s; NaN where there is none."""
        return (1.0 - self.slip) * self.tip_speed * np.sin(nearest_attack(angle, self.legs))


def nearest_attack(angle: Array | float, legs: Array) -> Array:
    """Attack angle, rad, of the leg closest to vertical; pi/2 where it points straight down.

    `angle`: rotation of the wheel since a leg pointed straight down, rad.
    """
    pitch = 2.0 * np.pi / legs
    return 0.5 * np.pi + angle - pitch * np.round(angle / pitch)


#: (plates, drive, hub, angle at the start, at the end) -> (hub at the end, ground reaction, whether
#: the step has converged, (cases,)).
StepMethod: TypeAlias = Callable[
    [PlateBatch, DriveParameters, HubState, float, float], tuple[HubState, GroundReaction, Array]
]


def select_cases(state: Cases, cases: Array) -> Cases:
    """A subset of the cases of a record of arrays whose last axis is the cases."""
    return type(state)(**{f.name: getattr(state, f.name)[..., cases] for f in fields(state)})


def replace_cases(state: Cases, part: Cases, cases: Array) -> Cases:
    """The record with `part` in place of those cases."""
    whole = {f.name: getattr(state, f.name).copy() for f in fields(state)}
    for name, array in whole.items():
        array[..., cases] = getattr(part, name)
    return type(state)(**whole)


def implicit_step(
    plates: PlateBatch,
    drive: DriveParameters,
    hub: HubState,
    start: float,
    stop: float,
    depth: int = 0,
) -> tuple[HubState, GroundReaction, Array]:
    r"""Advance the hub from one wheel angle to another by an implicit Euler step.

    .. math:: M (v' - v) / dt = F(v', z + v'_z dt) - M g

    is solved by a damped Newton method in both velocities. Cases that do not converge, or whose
    velocity changes abruptly, take the step in two halves, recursively (`depth`). A case with a
    commanded slip has its horizontal velocity prescribed.

    Returns the state and the reaction at the end of the step, and whether the forces balance there,
    (cases,).
    """
    end, reaction, converged = _solve_step(plates, drive, hub, start, stop)
    abrupt = np.abs(end.vz - hub.vz) > ABRUPT_CHANGE * drive.tip_speed
    repeated = np.flatnonzero(~converged | (abrupt & (depth < MAX_ABRUPT_BISECTIONS)))
    if repeated.size and depth < MAX_BISECTIONS:
        middle = 0.5 * (start + stop)
        some_plates, some_drives = plates.select(repeated), select_cases(drive, repeated)
        halfway, _, first_converged = implicit_step(
            some_plates, some_drives, select_cases(hub, repeated), start, middle, depth + 1
        )
        converged[repeated] = False
        continued, kept = repeated[first_converged], np.flatnonzero(first_converged)
        if continued.size:
            part_end, part_reaction, converged[continued] = implicit_step(
                some_plates.select(kept),
                select_cases(some_drives, kept),
                select_cases(halfway, kept),
                middle,
                stop,
                depth + 1,
            )
            end = replace_cases(end, part_end, continued)
            reaction = replace_cases(reaction, part_reaction, continued)
    return end, reaction, converged


def _solve_step(
    plates: PlateBatch, drive: DriveParameters, hub: HubState, start: float, stop: float
) -> tuple[HubState, GroundReaction, Array]:
    """Newton's method for the velocities at the end of one step."""
    pose, dt = plates.at(stop), (stop - start) / plates.speed
    target = drive.target_velocity(stop)
    commanded = ~np.isnan(drive.slip)
    weight, inertia = drive.mass * GRAVITY, drive.mass / dt

    def imbalance(vx: Array, vz: Array) -> tuple[Array, Array, Array, GroundReaction]:
        """Residual forces (x, z), N, their norm over the weight, and the ground reaction."""
        reaction = ground_reaction(plates, pose, hub.z + vz * dt, vx, vz, drive.fading)
        rx = np.where(commanded, 0.0, inertia * (vx - hub.vx) - reaction.ahead)
        rz = inertia * (vz - hub.vz) - reaction.up + weight
        return rx, rz, np.hypot(rx, rz) / weight, reaction

    vx, vz = np.where(commanded, target, hub.vx), hub.vz
    rx, rz, norm, reaction = imbalance(vx, vz)
    for _ in range(MAX_NEWTON_STEPS):
        if np.all(norm < TOLERANCE):
            break
        dx, dz = _newton_update(reaction, rx, rz, inertia, dt, commanded)
        length = np.maximum(np.hypot(dx, dz), 1e-300)
        share = np.minimum(1.0, MAX_UPDATE * drive.tip_speed / length)
        share = np.where(norm < TOLERANCE, 0.0, share)
        for halving in range(MAX_HALVINGS):
            trial = imbalance(vx + share * dx, vz + share * dz)
            worse = ~(trial[2] < norm) & (share > 0.0)
            if halving == MAX_HALVINGS - 1 or not np.any(worse):
                break
            share = np.where(worse, 0.5 * share, share)
        vx, vz = vx + share * dx, vz + share * dz
        rx, rz, norm, reaction = trial
    end = HubState(hub.x + vx * dt, hub.z + vz * dt, vx, vz)
    return end, reaction, norm < TOLERANCE


def _newton_update(
    reaction: GroundReaction, rx: Array, rz: Array, inertia: Array, dt: Array, commanded: Array
) -> tuple[Array, Array]:
    """Newton update of both velocities, or of the vertical one where the other is commanded.

    The Jacobian of the residual is inertia - dF/dv, with dF/dz dt added in the column of vz.
    """
    xx = inertia - reaction.velocity_jacobian[0, 0]
    xz = -reaction.velocity_jacobian[0, 1] - reaction.height_derivative[0] * dt
    zx = -reaction.velocity_jacobian[1, 0]
    zz = inertia - reaction.velocity_jacobian[1, 1] - reaction.height_derivative[1] * dt
    xx, xz, zx = (np.where(commanded, fixed, free) for fixed, free in ((1, xx), (0, xz), (0, zx)))
    determinant = xx * zz - xz * zx
    return (xz * rz - zz * rx) / determinant, (zx * rx - xx * rz) / determinant


def explicit_step(
    plates: PlateBatch, drive: DriveParameters, hub: HubState, start: float, stop: float
) -> tuple[HubState, GroundReaction, Array]:
    """The paper's explicit step (eq. 8), with the forces at its start; requires about 1e-4 s."""
    dt, commanded = (stop - start) / plates.speed, ~np.isnan(drive.slip)
    reaction = ground_reaction(plates, plates.at(start), hub.z, hub.vx, hub.vz, drive.fading)
    free_vx = hub.vx + reaction.ahead / drive.mass * dt
    vx = np.where(commanded, drive.target_velocity(stop), free_vx)
    vz = hub.vz + (reaction.up / drive.mass - GRAVITY) * dt
    return HubState(hub.x + vx * dt, hub.z + vz * dt, vx, vz), reaction, np.isfinite(vz)


HALVINGS = 40  # Bisection steps for the height of the hub at the start


class WalkStatus(IntEnum):
    """Status of a case of a batch."""

    OK = 0
    INVALID = 1
    NO_CONTACT = 2
    SUNK = 3
    NOT_CONVERGED = 4

    @property
    def reason(self) -> str:
        """Description of the status."""
        return _REASONS[self]


_REASONS: dict[WalkStatus, str] = {
    WalkStatus.OK: "ok",
    WalkStatus.INVALID: "no walk: the wheel-leg, the ground or the commanded slip is invalid",
    WalkStatus.NO_CONTACT: "no walk: no leg ever reaches the ground; the legs are shorter than the "
    "clearance of the body, or the start was too high for the time simulated",
    WalkStatus.SUNK: "stopped: the ground is too soft, the hub reaches its surface",
    WalkStatus.NOT_CONVERGED: "stopped: no motion of the hub satisfies the force balance",
}


@dataclass(frozen=True)
class WalkSimulation:
    """The valid cases of a walk, and the method of integration."""

    plates: PlateBatch
    drive: DriveParameters
    angle_step: float  # rad
    step: StepMethod

    def run(self, count: int, height: float | None) -> tuple[Array, Array]:
        """Status, (cases,), and x, z, vx, vz, torque at `count` instants, (5, instants, cases).

        The values of a case that stops are NaN from then on.
        """
        cases = self.drive.mass.size
        status, touched = np.full(cases, int(WalkStatus.OK)), np.zeros(cases, bool)
        history = np.full((5, count, cases), np.nan)
        active, plates, drive = np.arange(cases), self.plates, self.drive
        hub = self._start(height)
        history[:, 0] = hub.x, hub.z, hub.vx, hub.vz, 0.0 * hub.x
        for i in range(1, count):
            angle = i * self.angle_step
            hub, reaction, balanced = self.step(plates, drive, hub, angle - self.angle_step, angle)
            if not np.all(touched[active]):
                low = (plates.at(angle).z + hub.z < 0.0) & (plates.area > 0.0)
                touched[active] |= np.any(low & (plates.turns > 0.0), axis=0)
            status[active[~balanced]] = WalkStatus.NOT_CONVERGED
            status[active[balanced & (hub.z <= 0.0)]] = WalkStatus.SUNK
            kept = balanced & (hub.z > 0.0)
            now = np.array([hub.x, hub.z, hub.vx, hub.vz, reaction.torque])
            history[:, i, active[kept]] = now[:, kept]
            if not np.all(kept):
                active, plates = active[kept], plates.select(kept)
                drive, hub = select_cases(drive, kept), select_cases(hub, kept)
                if not active.size:
                    break
        status[(status == WalkStatus.OK) & ~touched] = WalkStatus.NO_CONTACT
        return status, history

    def _start(self, height: float | None) -> HubState:
        """At rest at `height`, or where the ground carries the hub pushed straight down."""
        pose, still = self.plates.at(0.0), np.zeros(self.drive.mass.size)
        high = np.where(self.plates.area > 0.0, -pose.z, -np.inf).max(axis=0)
        low, pressed = still, replace(self.plates, speed=still)
        for _ in range(HALVINGS if height is None else 0):
            middle = 0.5 * (low + high)
            reaction = ground_reaction(pressed, pose, middle, still, still - 1.0, self.drive.fading)
            carries = reaction.up > self.drive.mass * GRAVITY
            low, high = np.where(carries, middle, low), np.where(carries, high, middle)
        return HubState(still, low if height is None else still + height, still, still)
