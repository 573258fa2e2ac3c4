"""The course of a batch of walks, instant by instant, and how each case ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.walking.ground_reaction import Batch, reaction
from soilml.systems.wheel_legs.walking.integrator import GRAVITY, Drive, Hub, Step, some

#: Halvings of the interval in which the hub's height at the start is sought.
HALVINGS = 40


class WalkStatus(IntEnum):
    """Why a case of a batch has, or has not, a walk."""

    OK = 0
    UNSOUND = 1
    NO_CONTACT = 2
    SUNK = 3
    NOT_CONVERGED = 4

    @property
    def reason(self) -> str:
        """The code in words."""
        return _REASONS[self]


_REASONS: dict[WalkStatus, str] = {
    WalkStatus.OK: "ok",
    WalkStatus.UNSOUND: "no walk: the wheel-leg, the ground or the commanded slip is not one "
    "that can be",
    WalkStatus.NO_CONTACT: "no walk: no leg ever reaches the ground; the legs are shorter than the "
    "clearance of the body, or the start was too high for the time simulated",
    WalkStatus.SUNK: "stopped: the ground is too soft, the hub reaches its surface",
    WalkStatus.NOT_CONVERGED: "stopped: no motion of the hub found that balances the forces",
}


@dataclass(frozen=True)
class Course:
    """Cases that can walk, and how their steps are taken."""

    given: Batch
    drive: Drive
    turn: float  # rad to a step
    step: Step

    def walked(self, count: int, height: float | None) -> tuple[Array, Array]:
        """Status, (cases,), and x, z, vx, vz, torque at `count` instants, (5, instants, cases).

        A case that stops leaves NaN behind it and is no longer computed.
        """
        cases = self.drive.mass.size
        status, touched = np.full(cases, int(WalkStatus.OK)), np.zeros(cases, bool)
        history = np.full((5, count, cases), np.nan)
        going, given, drive = np.arange(cases), self.given, self.drive
        hub = self._start(height)
        history[:, 0] = hub.x, hub.z, hub.vx, hub.vz, 0.0 * hub.x
        for i in range(1, count):
            angle = i * self.turn
            hub, found, balanced = self.step(given, drive, hub, angle - self.turn, angle)
            if not np.all(touched[going]):
                low = (given.at(angle).z + hub.z < 0.0) & (given.area > 0.0)
                touched[going] |= np.any(low & (given.turns > 0.0), axis=0)
            status[going[~balanced]] = WalkStatus.NOT_CONVERGED
            status[going[balanced & (hub.z <= 0.0)]] = WalkStatus.SUNK
            kept = balanced & (hub.z > 0.0)
            now = np.array([hub.x, hub.z, hub.vx, hub.vz, found.torque])
            history[:, i, going[kept]] = now[:, kept]
            if not np.all(kept):
                going, given = going[kept], given.of(kept)
                drive, hub = some(drive, kept), some(hub, kept)
                if not going.size:
                    break
        status[(status == WalkStatus.OK) & ~touched] = WalkStatus.NO_CONTACT
        return status, history

    def _start(self, height: float | None) -> Hub:
        """At rest, pushed straight down until the ground carries it; or at `height`, m."""
        pose, still = self.given.at(0.0), np.zeros(self.drive.mass.size)
        high = np.where(self.given.area > 0.0, -pose.z, -np.inf).max(axis=0)
        low, pressed = still, replace(self.given, speed=still)
        for _ in range(HALVINGS if height is None else 0):
            middle = 0.5 * (low + high)
            found = reaction(pressed, pose, middle, still, still - 1.0, self.drive.fading)
            carries = found.up > self.drive.mass * GRAVITY
            low, high = np.where(carries, middle, low), np.where(carries, high, middle)
        return Hub(still, low if height is None else still + height, still, still)
