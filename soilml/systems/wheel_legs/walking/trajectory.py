"""Time integration of a batch of walks, and the status of each case."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.ground_reaction import PlateBatch, ground_reaction
from soilml.systems.wheel_legs.integrator import (
    GRAVITY,
    DriveParameters,
    HubState,
    StepMethod,
    select_cases,
)

#: Bisection steps for the height of the hub at the start.
HALVINGS = 40


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
