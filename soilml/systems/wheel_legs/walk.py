"""Simulation of walking wheel-legs, many cases at once, and the stress on their plates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Array, Real
from soilml.errors import InputError
from soilml.systems.wheel_legs.geometry import WheelLeg
from soilml.systems.wheel_legs.ground_reaction import SKIN, batch_plates
from soilml.systems.wheel_legs.integrator import (
    FADING,
    DriveParameters,
    StepMethod,
    WalkSimulation,
    WalkStatus,
    implicit_step,
    nearest_attack,
)
from soilml.systems.wheel_legs.resistive_force import LinearGround, resistance


@dataclass(frozen=True)
class Walk:
    """Motion of the hub: arrays (instants, cases), SI; NaN after a case has stopped."""

    time: Array  # s
    angle: Array  # rad, rotation since the start, (instants,)
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
        """beta_W, rad: attack angle of the leg closest to vertical (eq. 9)."""
        return nearest_attack(self.angle[:, None], self.legs)

    @property
    def sinkage(self) -> Array:
        """z_W, m: depth of that leg's end (eq. 10); 0 above the ground."""
        return np.maximum(self.length * np.sin(self.attack) - self.z, 0.0)

    @property
    def slip(self) -> Array:
        r"""i_W: slip of the hub relative to rolling over a fixed foot.

        .. math:: i_W = 1 - v_x / (\omega \, l_L \sin\beta_W)

        Reference: eq. 11, in which the cosine must be a sine (at midstance the cosine is zero) and
        the time step is missing. Without contact there is no propulsion, and the slip is 1.
        """
        rolling = self.speed * self.length * np.sin(self.attack)
        in_contact = (self.sinkage > 0.0) & (rolling > 0.0)
        slip = 1.0 - self.vx / np.where(in_contact, rolling, 1.0)
        return np.where(in_contact | np.isnan(self.vx), slip, 1.0)

    @property
    def midstance(self) -> Array:
        """Whether a leg passes the vertical at the instant, (instants, cases)."""
        step = self.angle[1] - self.angle[0]
        return np.abs(self.attack - 0.5 * np.pi) <= 0.5001 * step

    def at_midstance(self, values: Array) -> Array:
        """Mean over the midstances of values at every instant, (instants, cases) -> (cases,)."""
        midstance = self.midstance
        return np.sum(np.where(midstance, values, 0.0), axis=0) / np.sum(midstance, axis=0)

    def after(self, angle: float) -> Walk:
        """The part of the walk after the wheel has turned by `angle`, rad."""
        late = self.angle >= angle - 1e-9
        parts = ("time", "angle", "x", "z", "vx", "vz", "torque")
        return Walk(
            **{name: getattr(self, name)[late] for name in parts},
            **{name: getattr(self, name) for name in ("status", "length", "legs", "speed")},
        )


def walk(
    wheel_legs: Sequence[WheelLeg] | WheelLeg,
    grounds: Sequence[LinearGround] | LinearGround,
    *,
    slip: Real | None = None,
    turns: float = 2.0,
    steps: int = 1000,
    height: float | None = None,
    fading: float = FADING,
    step: StepMethod = implicit_step,
) -> Walk:
    r"""Simulate the walk of every case from rest, with a leg pointing straight down (eqs. 7, 8).

    .. math:: M \dot v = F(v, z, \omega t) - M g

    solved for the hub's velocity at the end of each step (implicit): the ground reaction depends on
    the direction of motion and not on its speed, so that the equation is stiff.

    Parameters
    ----------
    wheel_legs, grounds
        One, or one for each case; one is used for all cases.
    slip
        Commanded slip, a number or one for each case; NaN or None where the wheel rolls freely.
    turns
        Duration in turns of the wheel.
    steps
        Steps per turn, at least 100.
    height
        Height of the hub at the start, m; by default where the ground carries it.
    fading
        Speed below which the direction of motion is regularised, as a fraction of the speed of the
        leg's end; see `ground_reaction`.
    step
        Integration method.

    Returns
    -------
    Walk
        Cases that fail have a `status` other than `WalkStatus.OK`; the others are not affected.

    Raises
    ------
    InputError
        For invalid settings, or numbers of cases that do not match.

    References
    ----------
    Comin and Saaj 2017, eqs. 7 and 8.

    Examples
    --------
    >>> from soilml.systems.wheel_legs import LinearGround, gait_metrics, wheel_leg
    >>> ground = LinearGround(stiffness=0.7e6)
    >>> result = walk(wheel_leg("LTF"), ground, slip=0.25, turns=1.0, steps=200)
    >>> metrics = gait_metrics(result)
    >>> round(float(metrics.mean_slip[0]), 2), round(float(metrics.mean_sinkage[0]), 2)  # 1, m
    (0.25, 0.06)
    """
    if not (steps >= 100 and 0.0 < turns < np.inf and fading > 0.0):
        raise InputError(
            f"steps {steps}, turns {turns:g}, fading {fading:g}: a walk needs at least 100 steps "
            "per turn, and turns and fading above 0"
        )
    if height is not None and not np.isfinite(height):
        raise InputError(f"the start height is {height:g} m; it must be a number")
    legs_, grounds_, slips = _cases(wheel_legs, grounds, slip)
    status = np.array([_status(*case) for case in zip(legs_, grounds_, slips, strict=True)])
    count = round(turns * steps) + 1
    history = np.full((5, count, len(legs_)), np.nan)
    valid = np.flatnonzero(status == WalkStatus.OK)
    if valid.size:
        valid_legs, valid_grounds = [legs_[i] for i in valid], [grounds_[i] for i in valid]
        drive = DriveParameters(
            mass=np.array([w.mass for w in valid_legs]),
            tip_speed=np.array([w.speed * w.leg.length for w in valid_legs]),
            legs=np.array([w.legs for w in valid_legs]),
            slip=slips[valid],
            fading=np.array([fading * w.speed * w.leg.length for w in valid_legs]),
        )
        simulation = WalkSimulation(
            batch_plates(valid_legs, valid_grounds), drive, 2.0 * np.pi / steps, step
        )
        status[valid], history[:, :, valid] = simulation.run(count, height)
    angle = 2.0 * np.pi / steps * np.arange(count)
    speed = np.array([np.nan if w.invalid_reason else w.speed for w in legs_])
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
    grounds: Sequence[LinearGround] | LinearGround,
    slip: Real | None,
) -> tuple[list[WheelLeg], list[LinearGround], Array]:
    """Lists of one entry per case; a single entry is used for all."""
    legs = [wheel_legs] if isinstance(wheel_legs, WheelLeg) else list(wheel_legs)
    under = [grounds] if isinstance(grounds, LinearGround) else list(grounds)
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


def _status(wheel_leg: WheelLeg, ground: LinearGround, slip: float) -> WalkStatus:
    commanded = not np.isnan(slip)
    invalid_slip = commanded and not -1.0 <= slip <= 1.0
    invalid = wheel_leg.invalid_reason or ground.invalid_reason or invalid_slip
    return WalkStatus.INVALID if invalid else WalkStatus.OK


@dataclass(frozen=True)
class PlateStress:
    """Positions of the plates (m, x along the walk, z up from the surface) and their stress (Pa).

    Arrays (plates,), ordered by leg (leg, tip, heel), with the body last. `ahead` and `up` are the
    components of the stress on the plate, 0 above the ground.
    """

    x: Array
    z: Array
    ahead: Array
    up: Array
    area: Array  # m^2


def plate_stresses(
    walked: Walk, instant: int, wheel: WheelLeg, ground: LinearGround, case: int = 0
) -> PlateStress:
    """Stress on every plate at an instant of a case of a walk (Comin and Saaj 2017, eq. 4)."""
    plates = batch_plates([wheel], [ground])
    pose = plates.at(float(walked.angle[instant]))
    x, z, vx, vz = (
        float(part[instant, case]) for part in (walked.x, walked.z, walked.vx, walked.vz)
    )
    turning = plates.speed * plates.turns
    across, upwards = vx + turning * pose.z, vz - turning * pose.x
    fading = FADING * wheel.speed * wheel.leg.length
    pace = np.sqrt(across**2 + upwards**2 + fading**2)
    sx, sz = resistance(pose.c2, pose.s2, across / pace, upwards / pace)
    depth = np.maximum(-(z + pose.z), 0.0)
    pressure = ground.stiffness * depth + ground.offset * (1.0 - np.exp(-depth / SKIN))
    parts = (x + pose.x, z + pose.z, pressure * sx, pressure * sz, plates.area)
    return PlateStress(*(part[:, 0] for part in parts))
