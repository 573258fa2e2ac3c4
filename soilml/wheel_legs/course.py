"""The course of a batch of walks, instant by instant, and how each case ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from soilml.arrays import Array
from soilml.wheel_legs.reaction import Batch
from soilml.wheel_legs.stepping import Drive, Hub, Step


class WalkStatus(IntEnum):
    """Why a case of a batch has, or has not, a walk."""

    OK = 0
    NO_WHEEL_LEG = 1
    NO_CONTACT = 2
    SUNK = 3
    NOT_CONVERGED = 4

    @property
    def reason(self) -> str:
        """The code in words."""
        return _REASONS[self]


_REASONS: dict[WalkStatus, str] = {
    WalkStatus.OK: "ok",
    WalkStatus.NO_WHEEL_LEG: "no walk: number of legs, mass, speed or a section's size is not "
    "one of a wheel-leg, or the ground is not one that carries",
    WalkStatus.NO_CONTACT: "no walk: no leg ever reaches the ground; the legs are shorter than the "
    "clearance of the body, or the start was too high for the time simulated",
    WalkStatus.SUNK: "stopped: the ground is too soft, the hub reaches its surface",
    WalkStatus.NOT_CONVERGED: "stopped: no motion of the hub found that balances the forces",
}


def nearest_attack(angle: Array, legs: Array) -> Array:
    """Attack angle, rad, of the leg nearest to straight down; pi/2 where it hangs straight.

    `angle`: what the wheel has turned since a leg hung straight down.
    """
    pitch = 2.0 * np.pi / legs
    return 0.5 * np.pi + angle - pitch * np.round(angle / pitch)


@dataclass(frozen=True)
class Course:
    """Cases that can walk, and how their steps are taken."""

    given: Batch
    drive: Drive
    legs: Array  # (cases,)
    turn: float  # rad to a step
    step: Step

    def walked(self, count: int, height: float | None) -> tuple[Array, Array]:
        """Status, (cases,), and x, z, vx, vz, torque at `count` instants, (5, instants, cases).

        A case that stops leaves NaN behind it, and its hub stays where it was.
        """
        solid, legs = self.given.area > 0.0, (self.given.area > 0.0) & (self.given.turns > 0.0)
        pose, still = self.given.at(0.0), np.zeros(self.legs.size)
        lowest = np.where(solid, -pose.z, -np.inf).max(axis=0)
        hub = Hub(still, lowest if height is None else still + height, still, still)
        history = np.full((5, count, self.legs.size), np.nan)
        history[:, 0] = hub.x, hub.z, hub.vx, hub.vz, still
        status, touched = np.full(self.legs.size, int(WalkStatus.OK)), np.zeros_like(still, bool)
        for i in range(1, count):
            pose, attack = self.given.at(i * self.turn), nearest_attack(i * self.turn, self.legs)
            target = (1.0 - self.drive.slip) * self.drive.pace * np.sin(attack)
            moved, found, balanced = self.step(
                self.given, pose, hub, self.drive, target, self.turn / self.given.speed
            )
            going = status == WalkStatus.OK
            status[going & (moved.z <= 0.0)] = WalkStatus.SUNK
            status[going & ~balanced] = WalkStatus.NOT_CONVERGED
            going = status == WalkStatus.OK
            if not np.any(going):
                break
            hub = moved.where(going, hub)
            touched |= np.any(legs & (pose.z + hub.z < 0.0), axis=0)
            now = np.array([hub.x, hub.z, hub.vx, hub.vz, found.torque])
            history[:, i] = np.where(going, now, np.nan)
        status[(status == WalkStatus.OK) & ~touched] = WalkStatus.NO_CONTACT
        return status, history
