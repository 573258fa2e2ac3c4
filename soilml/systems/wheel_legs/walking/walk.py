"""Wheel-legs walking over time: forces from the ground move the hub, many cases at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Array, Real
from soilml.errors import InputError
from soilml.systems.wheel_legs.walking.geometry import WheelLeg
from soilml.systems.wheel_legs.walking.ground_reaction import batch
from soilml.systems.wheel_legs.walking.integrator import (
    FADING,
    Drive,
    Step,
    implicit,
    nearest_attack,
)
from soilml.systems.wheel_legs.walking.linear_ground import Ground
from soilml.systems.wheel_legs.walking.trajectory import Course, WalkStatus


@dataclass(frozen=True)
class Walk:
    """The hub over time: arrays (instants, cases), SI; NaN from where a case has stopped."""

    time: Array  # s
    angle: Array  # rad, turned since the start, (instants,)
    x: Array  # m
    z: Array  # m, height of the hub above the free surface
    vx: Array  # m/s
    vz: Array  # m/s
    torque: Array  # N m
    status: Array  # codes of WalkStatus, (cases,)
    length: Array  # m, of the leg, (cases,)
    legs: Array  # (cases,)
    speed: Array  # rad/s, (cases,)

    @property
    def attack(self) -> Array:
        """beta_W, rad: attack angle of the leg nearest to straight down (eq. 9)."""
        return nearest_attack(self.angle[:, None], self.legs)

    @property
    def sinkage(self) -> Array:
        """z_W, m: depth of that leg's end (eq. 10); 0 where it hangs above the ground."""
        return np.maximum(self.length * np.sin(self.attack) - self.z, 0.0)

    @property
    def slip(self) -> Array:
        r"""i_W: what the hub lacks of the travel of a hub over a foot that stands.

        .. math:: i_W = 1 - v_x / (\omega \, l_L \sin\beta_W)

        Reference: eq. 11, whose cosine must be a sine (at midstance the cosine is zero) and which
        lost the time step. Where the leg does not reach the ground nothing propels, and it is 1.
        """
        rolling = self.speed * self.length * np.sin(self.attack)
        stands = (self.sinkage > 0.0) & (rolling > 0.0)
        slip = 1.0 - self.vx / np.where(stands, rolling, 1.0)
        return np.where(stands | np.isnan(self.vx), slip, 1.0)

    @property
    def midstance(self) -> Array:
        """Whether a leg passes straight down at the instant, (instants, cases)."""
        step = self.angle[1] - self.angle[0]
        return np.abs(self.attack - 0.5 * np.pi) <= 0.5001 * step

    def at_midstance(self, values: Array) -> Array:
        """Mean over the midstances of values at every instant, (instants, cases) -> (cases,)."""
        there = self.midstance
        return np.sum(np.where(there, values, 0.0), axis=0) / np.sum(there, axis=0)

    def after(self, angle: float) -> Walk:
        """The walk from when the wheel has turned by `angle`, rad."""
        late = self.angle >= angle - 1e-9
        parts = ("time", "angle", "x", "z", "vx", "vz", "torque")
        return Walk(
            **{name: getattr(self, name)[late] for name in parts},
            **{name: getattr(self, name) for name in ("status", "length", "legs", "speed")},
        )


def walk(
    wheel_legs: Sequence[WheelLeg] | WheelLeg,
    grounds: Sequence[Ground] | Ground,
    *,
    slip: Real | None = None,
    turns: float = 2.0,
    steps: int = 1000,
    height: float | None = None,
    fading: float = FADING,
    step: Step = implicit,
) -> Walk:
    r"""Walk every case: a wheel-leg on a ground, from rest, a leg straight down (eqs. 7 and 8).

    .. math:: M \dot v = F(v, z, \omega t) - M g

    solved for the hub's velocity at the end of each step (implicit, `steps` to a turn): the ground
    answers to the direction of motion and not to its speed, so that the equation is stiff. The
    wheels roll freely, or with the commanded `slip` (a number, or one for each case, NaN where it
    rolls freely). The hub starts where the ground carries it when pushed straight down, or at
    `height`, m. `fading` is a share of the leg end's speed, see `reaction`. Cases that fail carry
    a status. Raises `InputError` for settings of no simulation.
    """
    if not (steps >= 100 and 0.0 < turns < np.inf and fading > 0.0):
        raise InputError(
            f"steps {steps}, turns {turns:g}, fading {fading:g}: a walk needs at least 100 steps "
            "to a turn, and turns and fading above 0"
        )
    if height is not None and not np.isfinite(height):
        raise InputError(f"a height of {height:g} m to start from; it must be a number")
    legs_, grounds_, slips = _cases(wheel_legs, grounds, slip)
    status = np.array([_status(*case) for case in zip(legs_, grounds_, slips, strict=True)])
    count = round(turns * steps) + 1
    history = np.full((5, count, len(legs_)), np.nan)
    going = np.flatnonzero(status == WalkStatus.OK)
    if going.size:
        able, under = [legs_[i] for i in going], [grounds_[i] for i in going]
        drive = Drive(
            mass=np.array([w.mass for w in able]),
            pace=np.array([w.speed * w.leg.length for w in able]),
            legs=np.array([w.legs for w in able]),
            slip=slips[going],
            fading=np.array([fading * w.speed * w.leg.length for w in able]),
        )
        course = Course(batch(able, under), drive, 2.0 * np.pi / steps, step)
        status[going], history[:, :, going] = course.walked(count, height)
    angle = 2.0 * np.pi / steps * np.arange(count)
    speed = np.array([np.nan if w.flaw else w.speed for w in legs_])
    return Walk(
        time=angle[:, None] / speed,
        angle=angle,
        x=history[0],
        z=history[1],
        vx=history[2],
        vz=history[3],
        torque=history[4],
        status=status,
        length=np.array([w.leg.length for w in legs_]),
        legs=np.array([max(w.legs, 1) for w in legs_]),
        speed=speed,
    )


def _cases(
    wheel_legs: Sequence[WheelLeg] | WheelLeg,
    grounds: Sequence[Ground] | Ground,
    slip: Real | None,
) -> tuple[list[WheelLeg], list[Ground], Array]:
    """Cases side by side; one stands for all."""
    legs = [wheel_legs] if isinstance(wheel_legs, WheelLeg) else list(wheel_legs)
    under = [grounds] if isinstance(grounds, Ground) else list(grounds)
    slips = np.atleast_1d(np.asarray(np.nan if slip is None else slip, float))
    count = max(len(legs), len(under), slips.size)
    if min(len(legs), len(under), slips.size) == 0:
        raise InputError("no case to walk: give at least one wheel-leg and one ground")
    for name, size in (("wheel-legs", len(legs)), ("grounds", len(under)), ("slips", slips.size)):
        if size not in (1, count):
            raise InputError(f"{size} {name} for {count} cases: give one, or one for each case")
    return (
        legs * (count // len(legs)),
        under * (count // len(under)),
        np.broadcast_to(slips, (count,)).copy(),
    )


def _status(wheel_leg: WheelLeg, ground: Ground, slip: float) -> WalkStatus:
    told = not np.isnan(slip)
    flaw = wheel_leg.flaw or ground.flaw or (told and not -1.0 <= slip <= 1.0)
    return WalkStatus.UNSOUND if flaw else WalkStatus.OK
