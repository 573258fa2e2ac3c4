"""Simulated wheels and rovers on a known soil: readings, climbs and stresses to test with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.physics.soils import Soil
from soilml.systems.rim_stress.ability import pull_and_slope_at
from soilml.systems.rim_stress.climbs import (
    Climb,
    Rover,
    ShearParameters,
    Uncertainty,
    WheelRun,
)
from soilml.systems.rim_stress.force_balance import SteadyRun, WheelBalance, magnification
from soilml.systems.rim_stress.stress import SensingWheel, StressProfile

#: Slopes of the test field and artificial slips on the flat, as in Nagatani et al., sections 3, 5.
SLOPES = tuple(np.deg2rad([0.0, 4.0, 8.0, 10.0, 12.0]).tolist())
ARTIFICIAL_SLIPS = (0.04, 0.13, 0.36, 0.68)
SAMPLING = 0.0083  # rad between samples: a rim speed of 9.15 mm/s, r = 0.055 m, sampled every 50 ms
CHORDS = 48  # Points across the diameter of a sensor
HALVINGS = 40  # Bisection steps for the middle of an arc


def simulate_readings(
    profile: StressProfile,
    wheel: SensingWheel,
    *,
    turns: int = 9,
    crown: float = 0.0,
    lugs: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
) -> dict[str, Floats]:
    r"""Simulate the readings of a true stress profile, each turn at a random phase.

    Returns the columns that `bin_stress` takes.

    A sensor averages the stress over its disc, less the part carried by the lugs; noise, deadband
    and saturation follow. At y half widths from the middle of the rim the stress is
    (1 + crown (1 - 3 y^2)) times the profile's, so that its mean over the width is unchanged.
    `lugs` are the fractions of the stress that lugs carry at the entry and at the exit of the arc.
    References: Nagatani et al. 2009, sections III to V; the distributions across the rim and along
    the lugs are our own.
    """
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
    columns = {"angle_rad": wide, "sensor": number, "force_N": force}
    return {name: values.ravel() for name, values in columns.items()}


@dataclass(frozen=True)
class StressArc:
    """A stressed arc that moves forward with slip.

    Entry angle (rad) a + b s^d; width in rad; the stress runs as x^p (1 - x)^q from exit to
    entry, x from 0 to 1.
    """

    entry: float = 0.33
    shift: float = 0.28
    shift_exponent: float = 1.5
    width: float = 0.53
    rear_exponent: float = 1.4
    front_exponent: float = 0.9

    def stress(self, slip: float, angle: Floats | None = None) -> StressProfile:
        """Stress at angles (p,), rad, by default over the arc; its maximum is 1."""
        entry = self.entry + self.shift * float(max(slip, 0.0) ** self.shift_exponent)
        at = np.linspace(entry - self.width, entry, 101) if angle is None else angle
        x = np.clip((at - entry + self.width) / self.width, 0.0, 1.0)
        peak = self.rear_exponent / (self.rear_exponent + self.front_exponent)
        largest = peak**self.rear_exponent * (1.0 - peak) ** self.front_exponent
        return StressProfile(at, x**self.rear_exponent * (1.0 - x) ** self.front_exponent / largest)


@dataclass(frozen=True)
class SimulatedRover:
    """A rover on a known soil; the stresses under its wheels follow `arcs`, not a sinkage model.

    `noise` describes its sensors: the relative error of the speed is uniform within sqrt(3) times
    its standard deviation; the entry angle is not measured but follows from the noisy stress.
    `noise.front_load` is the relative difference between the magnifications of front and rear
    wheels, which sense the stress over `magnification`.
    """

    rover: Rover = field(
        default_factory=lambda: Rover(
            mass=12.0, radius=0.055, width=0.064, front_share=0.52, height_ratio=0.4
        )
    )
    shear: ShearParameters = (0.0, float(np.deg2rad(38.0)), 0.0072)
    arcs: tuple[StressArc, StressArc] = (StressArc(), StressArc(entry=0.31, width=0.50))
    noise: Uncertainty = field(default_factory=Uncertainty)
    magnification: float = 1.3

    @cached_property
    def curve(self) -> tuple[Floats, Floats, Floats]:
        """Slip of all wheels (n,), true pull on level ground (N) and slope (rad) climbed at it."""
        slips, share = np.linspace(0.005, 0.9, 100), self.rover.front_share
        found = [
            pull_and_slope_at(
                slip, [arc.stress(slip) for arc in self.arcs], self.rover, self.shear, share
            )
            for slip in slips.tolist()
        ]
        pull, slope = np.asarray(found, dtype=np.float64).T
        return slips, pull, slope

    def slip_at(self, slope: float) -> float:
        """The smallest slip at which the rover climbs a slope; raises `InputError` if none."""
        slips, _, slopes = self.curve
        above = np.flatnonzero(slopes >= slope)
        if len(above) == 0:
            raise InputError(
                f"slope {slope:.3g} rad: this rover climbs no steeper than {self.steepest:.3g} rad"
            )
        i = max(int(above[0]), 1)
        return float(np.interp(slope, slopes[i - 1 : i + 1], slips[i - 1 : i + 1]))

    @property
    def steepest(self) -> float:
        """The steepest slope (rad) that the rover climbs."""
        return float(self.curve[2].max())

    def simulate_climbs(
        self, rng: np.random.Generator, slopes: Sequence[float] = SLOPES, repeats: int = 4
    ) -> list[Climb]:
        """Each slope climbed `repeats` times, as measured by the sensors."""
        climbs = []
        for slope in slopes:
            slip = self.slip_at(slope)
            for turn in range(repeats):
                error = self._speed_error(rng)
                front, rear = (self.measure(i, slip, slope, rng, error) for i in (0, 1))
                name = f"{np.rad2deg(slope):.3g}deg_{turn + 1}"
                reading = slope + self.noise.slope_rad * rng.normal()
                climbs.append(Climb(name, float(reading), front, rear))
        return climbs

    def simulate_artificial_slip(
        self, rng: np.random.Generator, slips: Sequence[float] = ARTIFICIAL_SLIPS, repeats: int = 5
    ) -> tuple[list[WheelRun], list[WheelRun]]:
        """Stress on front and on rear wheels at artificial slips on level ground."""
        front, rear = (
            [
                self.measure(i, slip, 0.0, rng, self._speed_error(rng))
                for slip in slips
                for _ in range(repeats)
            ]
            for i in (0, 1)
        )
        return front, rear

    def _speed_error(self, rng: np.random.Generator) -> float:
        return float(np.sqrt(3.0) * self.noise.speed_m_s.share * rng.uniform(-1.0, 1.0))

    def measure(
        self, i: int, slip: float, slope: float, rng: np.random.Generator, speed_error: float
    ) -> WheelRun:
        """Slip and stress as wheel i of `WHEELS` measures them: the true stress over M, noise."""
        cohesion, friction, modulus = self.shear
        true = WheelRun(slip, self.arcs[i].stress(slip))
        (parts,) = self.rover.parts([true], modulus)
        scale = magnification(parts, self.rover.loads(slope)[i], cohesion, np.tan(friction))
        # front and rear differ by front_load, so that each deviates by front_load / sqrt(2)
        deviation = self.noise.front_load * rng.normal() / np.sqrt(2.0)
        of_sensors = self.magnification * np.exp(deviation)
        angle: Floats = SAMPLING * (np.arange(-30.0, 115.0) + rng.random())
        normal = scale / of_sensors * self.arcs[i].stress(slip, angle).normal
        noise = self.noise.normal_Pa.share
        normal = normal * (1.0 + noise * np.clip(rng.normal(size=len(normal)), -3.0, 3.0))
        read = 1.0 - (1.0 - slip) * (1.0 + speed_error)
        return WheelRun(read, StressProfile(angle, normal), noise * normal)


def parabolic_arc(
    middle: float, length: float, peak: float, lean: float = 0.0, points: int = 201
) -> StressProfile:
    r"""A parabola of normal stress over an arc of the rim, optionally skewed forward.

    .. math::
        \sigma = \sigma_p (1 - u^2)(1 + \lambda u), \quad u = 2 (\theta - \theta_c) / l

    `middle` and `length` in rad, `peak` (Pa) the stress at the middle, `lean` from -1 to 1. The
    shape is our choice: Nagatani et al. 2009 print the length of the arc (section IV), and its
    shape only as a figure.
    """
    u = np.linspace(-1.0, 1.0, points)
    normal = peak * (1.0 - u**2) * (1.0 + lean * u)
    return StressProfile(middle + 0.5 * length * u, np.maximum(normal, 0.0))


def balanced_arc(
    length: float, at: SteadyRun, wheel: SensingWheel, soil: Soil, lean: float = 0.0
) -> StressProfile:
    """The arc of this length (rad) that satisfies both force balances of the run.

    The further forward an arc is, the smaller its pull: its middle is found by bisection over all
    positions below the axle, its magnitude from the load. Nagatani et al. 2009 print k_x and the
    length of the arc but not its position; this is the position consistent with both, at the shear
    modulus of the soil. Raises `FitError` if there is none.
    """
    balance, modulus = WheelBalance.of(wheel, soil), float(soil.shear_modulus)

    def too_far_back(middle: float) -> bool:
        arc = parabolic_arc(middle, length, 1.0, lean)
        # NaN where its shear pulls the wheel down
        return not float(balance.pull(arc, at, modulus)) <= at.required

    rear, front = -0.45 * np.pi + 0.5 * length, 0.45 * np.pi - 0.5 * length
    if not rear < front or not too_far_back(rear) or too_far_back(front):
        raise FitError(
            f"no position of an arc of {length:g} rad lets the wheel pull {at.required:.3g} N at "
            f"slip {float(at.slip):g}"
        )
    for _ in range(HALVINGS):
        middle = 0.5 * (rear + front)
        rear, front = (middle, front) if too_far_back(middle) else (rear, middle)
    arc = parabolic_arc(front, length, 1.0, lean)
    return parabolic_arc(front, length, balance.magnification(arc, at, modulus), lean)
