"""Drawbar pull against slip, and the steepest slope, on ground not yet driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Real
from soilml.errors import FitError, InputError
from soilml.systems.climbing.climb import WheelRun
from soilml.systems.climbing.identify import Ground
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.stress_by_slip import StressBySlip
from soilml.systems.climbing.wheel_force_parts import Parts, parts

Floats = NDArray[np.float64]

#: Slips of the curve; redrawn stresses, and soils taken with each.
SLIPS, REDRAWN, SOILS = 25, 24, 16
#: Shares of draws below the band and below its upper end.
BAND = (0.05, 0.95)


@dataclass(frozen=True)
class Band:
    """Middle of the draws and the band that holds nine tenths of them; arrays of one shape."""

    middle: Floats
    lower: Floats
    upper: Floats


@dataclass(frozen=True)
class Ability:
    """What a rover will do on this ground, within the slips at which stress was measured."""

    slip: Floats  # (n,)
    pull: Floats  # (draws, n), N, drawbar pull of the rover on the flat
    slope: Floats  # (draws, n), rad, that it climbs steadily at each slip

    @property
    def steepest(self) -> Floats:
        """The steepest slope of each draw, rad (draws,)."""
        return np.asarray(self.slope.max(axis=1))

    @property
    def steepest_slip(self) -> Floats:
        """The slip at which each draw climbs it (draws,)."""
        return np.asarray(self.slip[np.argmax(self.slope, axis=1)])

    @property
    def open_end(self) -> float:
        """Share of draws whose slope still rises at the highest slip: they might do more."""
        return float(np.mean(np.argmax(self.slope, axis=1) == len(self.slip) - 1))

    def steepest_within(self, slip_limit: float) -> Floats:
        """The steepest slope (rad) of each draw at slips up to a limit.

        Raises `InputError` for a limit outside the slips at which stress was measured.
        """
        check_slip(slip_limit, (float(self.slip[0]), float(self.slip[-1])))
        at = np.asarray([np.interp(slip_limit, self.slip, slope) for slope in self.slope])
        below = np.where(self.slip <= slip_limit, self.slope, -np.inf).max(axis=1)
        return np.asarray(np.maximum(at, below))


def band(draws: Floats) -> Band:
    """The band of draws (draws, ...)."""
    lower, middle, upper = np.quantile(draws, (BAND[0], 0.5, BAND[1]), axis=0)
    return Band(middle, lower, upper)


def shared_slips(front: StressBySlip, rear: StressBySlip) -> tuple[float, float]:
    """From which to which slip the stress of both wheels is known; raises `FitError` if none."""
    lowest, highest = max(front.lowest, rear.lowest), min(front.highest, rear.highest)
    if not lowest < highest:
        raise FitError(
            f"stress was measured on the front wheel at slips {front.lowest:.3g} to "
            f"{front.highest:.3g} and on the rear at {rear.lowest:.3g} to {rear.highest:.3g}; "
            "needed are slips that both had"
        )
    return lowest, highest


def check_slip(limit: float, measured: tuple[float, float]) -> None:
    """Raise `InputError` for a slip limit outside the slips at which stress was measured."""
    if not measured[0] <= limit <= measured[1]:
        raise InputError(
            f"slip limit {limit:g}: stress was measured at slips from {measured[0]:.3g} to "
            f"{measured[1]:.3g} only; nothing is said outside"
        )


def climbing_ability(
    ground: Ground, front: StressBySlip, rear: StressBySlip, *, seed: int = 0
) -> Ability:
    """Pull against slip, and slope against slip, for draws of soil, stress and front load.

    All wheels slip alike. The curve runs over the slips at which the stress of both front and
    rear wheels was measured. References: Nagatani et al., section 7. Raises `FitError` where
    front and rear share no slips.
    """
    lowest, highest = shared_slips(front, rear)
    rng = np.random.default_rng(seed)
    slip = np.linspace(lowest, highest, SLIPS)
    pull, slope = [], []
    for _ in range(REDRAWN):
        soils = ground.as_read[rng.integers(len(ground.as_read), size=SOILS)]
        off = 1.0 + ground.noise.front_load * rng.normal(size=SOILS)
        share = np.clip((ground.rover.front_share or 0.5) * off, 0.05, 0.95)
        profiles = [w.redrawn(rng).profiles(slip) for w in (front, rear)]
        columns = []
        for s, *both in zip(slip, *profiles, strict=True):
            wheels = [parts(WheelRun(float(s), p), ground.rover, soils[:, 2]) for p in both]
            grip = grip_of_rover(
                ground.rover, (wheels[0], wheels[1]), soils[:, 0], np.tan(soils[:, 1]), share
            )
            columns.append((grip.pull(0.0), grip.slope()))
        found: Floats = np.asarray(columns)  # (n, 2, SOILS)
        pull.append(found[:, 0].T)
        slope.append(found[:, 1].T)
    return Ability(slip=slip, pull=np.concatenate(pull), slope=np.concatenate(slope))


@dataclass(frozen=True)
class Grip:
    """Drawbar pull of a rover as `across` cos(slope) + `along` sin(slope) + `stuck`, N."""

    weight: float
    across: Real
    along: Real
    stuck: Real

    def pull(self, slope: Real) -> Real:
        """Drawbar pull on a slope (rad), N."""
        return self.across * np.cos(slope) + self.along * np.sin(slope) + self.stuck

    def slope(self) -> Real:
        """The slope (rad) on which the pull carries the weight's part down it."""
        needed = self.weight - self.along
        held = np.clip(self.stuck / np.hypot(needed, self.across), -1.0, 1.0)
        return np.arctan2(self.across, needed) + np.arcsin(held)


def grip_of_rover(
    rover: Rover,
    wheels: tuple[Parts, Parts],
    cohesion: Real,
    tangent: Real,
    front_share: Real,
) -> Grip:
    r"""Pull of a rover whose wheels stand at one slip, on any slope.

    With each wheel's pull over load :math:`\rho` on soil without cohesion, loads
    :math:`a \cos\alpha - h \sin\alpha` and :math:`(1 - a) \cos\alpha + h \sin\alpha`, and M of
    each wheel from its load,

    .. math::
        F_x = m g [(a \rho_f + (1 - a) \rho_r) \cos\alpha + h (\rho_r - \rho_f) \sin\alpha]
              + 2 c \sum (C_x - \rho C_z)
    """
    front, rear = (
        (w.pressure_pull + tangent * w.friction_pull)
        / (w.pressure_lift + tangent * w.friction_lift)
        for w in wheels
    )
    stuck = sum(
        w.cohesion_pull - ratio * w.cohesion_lift
        for w, ratio in zip(wheels, (front, rear), strict=True)
    )
    height = rover.height_ratio or 0.0
    return Grip(
        weight=rover.weight,
        across=rover.weight * (front_share * front + (1.0 - front_share) * rear),
        along=rover.weight * height * (rear - front),
        stuck=2.0 * cohesion * stuck,
    )
