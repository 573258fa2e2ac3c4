"""Readings of force sensors in the rim of a turning wheel, and their means in bins of angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Real
from soilml.errors import InputError
from soilml.parameters import Parameter, check
from soilml.systems.rim_stress.stress_profile import StressProfile

CHORDS = 48  # Points across the diameter of a sensor


@final
@dataclass(frozen=True, kw_only=True)
class SensingWheel:
    """A wheel with a row of round force sensors across its rim.

    The defaults are the wheel of Nagatani et al. 2009, sections III and IV. The positions of the
    sensors in the row and their noise are not printed: even spacing and 0.02 N are assumed.
    """

    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r")] = 0.055
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b")] = 0.064
    sensors: Annotated[Real, Parameter("1", 1, 1000, "in the row")] = 4
    diameter: Annotated[Real, Parameter("m", 1e-4, 0.1, "of the sensing area")] = 0.0095
    interval: Annotated[Real, Parameter("s", 1e-5, 10.0, "between samples")] = 0.05
    rim_speed: Annotated[Real, Parameter("m/s", 1e-5, 10.0, "r omega")] = 0.0104
    deadband: Annotated[Real, Parameter("N", 0.0, 1e3, "smaller forces read 0")] = 0.1
    saturation: Annotated[Real, Parameter("N", 1e-3, 1e5, "larger forces read this")] = 4.4
    noise: Annotated[Real, Parameter("N", 0.0, 1e3, "standard deviation of a sample")] = 0.02

    def __post_init__(self) -> None:
        check(self, "sensing wheel: ")
        if int(self.sensors) != self.sensors:
            raise InputError(f"the row has {self.sensors:g} sensors; needed is a whole number")
        if self.deadband >= self.saturation:
            raise InputError(
                f"the deadband ({self.deadband:g} N) must lie below saturation "
                f"({self.saturation:g} N)"
            )

    @property
    def area(self) -> float:
        """Sensing area of one sensor, m^2."""
        return 0.25 * math.pi * float(self.diameter) ** 2

    @property
    def step(self) -> float:
        """Angle (rad) through which the rim turns between two samples."""
        return float(self.interval * self.rim_speed / self.radius)

    @property
    def across(self) -> Floats:
        """Positions of the sensors across the rim, in half widths from its middle, (sensors,)."""
        count = int(self.sensors)
        return np.asarray((2.0 * np.arange(count) + 1.0) / count - 1.0)

    def chords(self, count: int) -> tuple[Floats, Floats]:
        """Angles (rad) from the centre of a sensor and area fractions there, (count,)."""
        turn = math.pi * np.arange(1, count + 1) / (count + 1)
        share = np.sin(turn) ** 2
        return 0.5 * self.diameter / self.radius * np.cos(turn), share / share.sum()


@final
@dataclass(frozen=True)
class SensorReadings:
    """Samples of the sensors over one or more turns, in any order, (n,) each.

    angle: From straight down, positive forward, rad. sensor: Number in the row, from 1. force: N.
    Raises `InputError` for other shapes, values that are not finite, and angles in degrees.
    """

    angle: Floats
    sensor: Floats
    force: Floats

    def __post_init__(self) -> None:
        for name in ("angle", "sensor", "force"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        shapes = {self.angle.shape, self.sensor.shape, self.force.shape}
        if len(shapes) > 1 or self.angle.ndim != 1 or len(self.angle) == 0:
            raise InputError(
                f"readings have angles, sensors and forces of shapes {self.angle.shape}, "
                f"{self.sensor.shape} and {self.force.shape}; needed is one row of samples each"
            )
        if not all(np.isfinite(v).all() for v in (self.angle, self.sensor, self.force)):
            raise InputError("readings contain values that are not finite; leave such samples out")
        if float(np.abs(self.angle).max()) > math.pi + 1e-6:
            raise InputError(
                f"readings reach to {float(np.abs(self.angle).max()):g} rad, more than half a "
                "turn; angles are in radians from straight down (np.deg2rad turns degrees into "
                "them)"
            )


def simulate_readings(
    profile: StressProfile,
    wheel: SensingWheel,
    *,
    turns: int = 9,
    crown: float = 0.0,
    lugs: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
) -> SensorReadings:
    r"""Simulate the readings of a true stress profile, each turn at a random phase.

    A sensor averages the stress over its disc, less the part carried by the lugs; noise, deadband
    and saturation follow. At y half widths from the middle of the rim the stress is
    (1 + crown (1 - 3 y^2)) times the profile's, so that its mean over the width is unchanged.

    Parameters
    ----------
    profile
        True normal stress.
    wheel
        The sensors.
    turns
        Number of turns recorded.
    crown
        Excess of the stress in the middle of the rim, as a fraction.
    lugs
        Fractions of the stress carried by the lugs at the entry and at the exit of the arc.
    seed
        Seed of phases and noise.

    Raises
    ------
    InputError
        For fewer than one turn, or fractions outside [0, 1).

    References
    ----------
    Nagatani et al. 2009, sections III to V; the distributions across the rim and along the lugs
    are our own.
    """
    if turns < 1:
        raise InputError(f"{turns} turns; needed is one or more")
    if not all(0.0 <= share < 1.0 for share in lugs):
        raise InputError(f"lugs carry the fractions {lugs}; each must be at least 0 and below 1")
    rng = np.random.default_rng(seed)
    samples = int(2.0 * math.pi / wheel.step)
    phase = rng.uniform(0.0, 1.0, (turns, 1))
    angle = math.pi - (np.arange(samples) + phase) * wheel.step
    at, normal = profile.angle, profile.normal
    forward = np.clip(
        (at - profile.exit_angle) / (profile.entry_angle - profile.exit_angle), 0.0, 1.0
    )
    sensed = normal * (1.0 - (lugs[1] + (lugs[0] - lugs[1]) * forward))
    offset, share = wheel.chords(CHORDS)
    mean = np.interp(angle[..., None] + offset, at, sensed, left=0.0, right=0.0) @ share
    over = 1.0 + crown * (1.0 - 3.0 * wheel.across**2)
    force = wheel.area * mean[..., None] * over
    force = force + rng.normal(0.0, 1.0, force.shape) * wheel.noise
    force = np.where(force < wheel.deadband, 0.0, np.minimum(force, wheel.saturation))
    number = np.broadcast_to(np.arange(1.0, wheel.sensors + 1.0), force.shape)
    wide = np.broadcast_to(angle[..., None], force.shape)
    return SensorReadings(wide.ravel(), number.ravel(), force.ravel())


@dataclass(frozen=True)
class MeasuredStress:
    """Mean stress over the sensing area (Pa) against the angle on the rim (rad), (points,) each.

    std: Standard deviation of the mean, Pa; of readings by the scatter between turns.
    in_range: Points whose samples all lie between deadband and saturation: `normal` is unbiased.
    saturated: Fraction of the samples with contact that are at saturation.
    """

    angle: Floats
    normal: Floats
    std: Floats
    in_range: NDArray[np.bool_]
    saturated: float = 0.0


def bin_stress(readings: SensorReadings, wheel: SensingWheel) -> MeasuredStress:
    """Average readings over turns and sensors, in bins as wide as one sampling interval turns.

    Raises `InputError` if no sample exceeds the deadband, or the number of sensors differs from the
    wheel's. References: Nagatani et al. 2009, section IV.
    """
    force, sensor = readings.force, readings.sensor.astype(int)
    count = int(wheel.sensors)
    if set(np.unique(sensor)) != set(range(1, count + 1)):
        raise InputError(
            f"readings of sensors {', '.join(map(str, np.unique(sensor)[:9]))}; the wheel has "
            f"{count} in a row, numbered from 1"
        )
    contact = (force > 0.0) & (force >= wheel.deadband)
    if not contact.any():
        raise InputError(
            f"readings without contact: every sample lies in the deadband of {wheel.deadband:g} N"
        )
    bins = math.ceil(2.0 * math.pi / wheel.step)
    angle_bin = np.minimum((readings.angle + math.pi) // wheel.step, bins - 1).astype(int)
    index = angle_bin * count + sensor - 1
    samples = np.bincount(index, minlength=bins * count).reshape(bins, count)
    occupied = (samples > 0).all(axis=1)
    samples = samples[occupied]

    def mean(value: Floats) -> Floats:
        """By bin and sensor, (bins, sensors)."""
        total = np.bincount(index, value, minlength=bins * count).reshape(bins, count)
        return np.asarray(total[occupied] / samples)

    stress = np.where(contact, force, 0.0) / wheel.area
    normal = mean(stress)
    variance = np.maximum(mean(stress**2) - normal**2, 0.0) / np.maximum(samples - 1, 1)
    in_range = contact & (force < wheel.saturation)
    return MeasuredStress(
        angle=mean(readings.angle).mean(axis=1),
        normal=normal.mean(axis=1),
        std=np.sqrt(variance.sum(axis=1)) / count,
        in_range=(mean(in_range.astype(np.float64)) == 1.0).all(axis=1),
        saturated=float((force >= wheel.saturation).sum() / contact.sum()),
    )
