"""A simulated rover on a known soil: climbs and stresses to test the identification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.systems.rim_stress.ability import slope_pull
from soilml.systems.rim_stress.climb import (
    WHEELS,
    Climb,
    Rover,
    ShearParameters,
    Uncertainty,
    WheelRun,
)
from soilml.systems.rim_stress.climb_balances import wheel_components
from soilml.systems.rim_stress.force_balance import (
    MohrCoulomb,
    SteadyRun,
    force_components,
    magnification,
    pull_under,
)
from soilml.systems.rim_stress.sensor_readings import SensingWheel
from soilml.systems.rim_stress.stress_profile import StressProfile

#: Slopes of the test field and artificial slips on the flat, as in Nagatani et al., sections 3, 5.
SLOPES = tuple(np.deg2rad([0.0, 4.0, 8.0, 10.0, 12.0]).tolist())
ARTIFICIAL_SLIPS = (0.04, 0.13, 0.36, 0.68)
SAMPLING = 0.0083  # rad between samples: a rim speed of 9.15 mm/s, r = 0.055 m, sampled every 50 ms


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

    def entry_angle(self, slip: float) -> float:
        """Entry angle at a slip, rad."""
        return self.entry + self.shift * float(max(slip, 0.0) ** self.shift_exponent)

    def stress(self, slip: float, angle: Floats) -> Floats:
        """Shape of the stress at angles (p,), with maximum 1."""
        entry = self.entry_angle(slip)
        x = np.clip((angle - entry + self.width) / self.width, 0.0, 1.0)
        peak = self.rear_exponent / (self.rear_exponent + self.front_exponent)
        largest = peak**self.rear_exponent * (1.0 - peak) ** self.front_exponent
        return np.asarray(x**self.rear_exponent * (1.0 - x) ** self.front_exponent / largest)


@dataclass(frozen=True)
class SimulatedRover:
    """A rover on a known soil; the stresses under its wheels follow `arcs`, not a sinkage model.

    `noise` describes its sensors: the relative error of the speed is uniform within sqrt(3) times
    its standard deviation; the entry angle is not measured but follows from the noisy stress.
    `stress` is the relative error of each sample, `noise.front_load` the relative difference
    between the magnifications of front and rear wheels.
    """

    rover: Rover = field(
        default_factory=lambda: Rover(
            mass=12.0, radius=0.055, width=0.064, front_share=0.52, height_ratio=0.4
        )
    )
    shear: ShearParameters = (0.0, float(np.deg2rad(38.0)), 0.0072)
    arcs: tuple[StressArc, StressArc] = (StressArc(), StressArc(entry=0.31, width=0.50))
    noise: Uncertainty = field(default_factory=Uncertainty)
    stress: float = 0.05
    magnification: float = 1.3

    @cached_property
    def curve(self) -> tuple[Floats, Floats, Floats]:
        """Slip of all wheels (n,), true pull on level ground (N) and slope (rad) climbed at it."""
        cohesion, friction, modulus = self.shear
        slips = np.linspace(0.005, 0.9, 100)
        pull_and_slope = []
        for slip in slips:
            wheels = [
                wheel_components(self._exact(arc, slip), self.rover, modulus) for arc in self.arcs
            ]
            share = self.rover.front_share or 0.5
            forces = slope_pull(self.rover, wheels, cohesion, np.tan(friction), share)
            pull_and_slope.append((forces.pull(0.0), forces.equilibrium_slope()))
        return slips, *np.asarray(pull_and_slope, dtype=np.float64).T

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
        scale = self.noise.speed_scale * rng.normal()
        climbs = []
        for slope in slopes:
            slip = self.slip_at(slope)
            for turn in range(repeats):
                error = scale + np.sqrt(3.0) * self.noise.speed * rng.uniform(-1.0, 1.0)
                wheels = [
                    self.measure(wheel, slip, slope, rng, speed_error=error) for wheel in WHEELS
                ]
                name = f"{np.rad2deg(slope):.3g}deg_{turn + 1}"
                reading = slope + self.noise.slope * rng.normal()
                climbs.append(Climb(name, float(reading), wheels[0], wheels[1]))
        return climbs

    def simulate_artificial_slip(
        self, rng: np.random.Generator, slips: Sequence[float] = ARTIFICIAL_SLIPS, repeats: int = 5
    ) -> tuple[list[WheelRun], list[WheelRun]]:
        """Stress on front and on rear wheels at artificial slips on level ground."""
        by_wheel: tuple[list[WheelRun], list[WheelRun]] = ([], [])
        for runs, wheel in zip(by_wheel, WHEELS, strict=True):
            for slip in slips:
                for _ in range(repeats):
                    error = np.sqrt(3.0) * self.noise.speed * rng.uniform(-1.0, 1.0)
                    runs.append(self.measure(wheel, slip, 0.0, rng, speed_error=error))
        return by_wheel

    def measure(
        self,
        wheel: str,
        slip: float,
        slope: float,
        rng: np.random.Generator,
        *,
        speed_error: float = 0.0,
    ) -> WheelRun:
        """Measured slip, and measured stress: the true one over M, with noise."""
        cohesion, friction, modulus = self.shear
        i = WHEELS.index(wheel)
        parts = wheel_components(self._exact(self.arcs[i], slip), self.rover, modulus)
        scale = magnification(parts, self.rover.loads(slope)[i], cohesion, np.tan(friction))
        # front and rear differ by front_load, so that each deviates by front_load / sqrt(2)
        deviation = self.noise.front_load * rng.normal() / np.sqrt(2.0)
        of_sensors = self.magnification * np.exp(deviation)
        angle: Floats = SAMPLING * (np.arange(-30.0, 115.0) + rng.random())
        normal = scale / of_sensors * self.arcs[i].stress(slip, angle)
        normal = normal * (1.0 + self.stress * np.clip(rng.normal(size=len(normal)), -3.0, 3.0))
        return WheelRun(
            slip=1.0 - (1.0 - slip) * (1.0 + speed_error),
            profile=StressProfile(angle, normal),
            normal_std=self.stress * normal,
        )

    def _exact(self, arc: StressArc, slip: float) -> WheelRun:
        entry = arc.entry_angle(slip)
        angle = np.linspace(entry - arc.width, entry, 101)
        return WheelRun(slip, StressProfile(angle, arc.stress(slip, angle)))


HALVINGS = 40  # Bisection steps for the middle of an arc


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
    length: float,
    at: SteadyRun,
    wheel: SensingWheel,
    strength: MohrCoulomb,
    shear_modulus: float,
    lean: float = 0.0,
) -> StressProfile:
    """The arc of this length (rad) that satisfies both force balances of the run.

    The further forward an arc is, the smaller its pull: its middle is found by bisection over all
    positions below the axle, its magnitude from the load. Nagatani et al. 2009 print k_x and the
    length of the arc but not its position; this is the position consistent with both. Raises
    `FitError` if there is none.
    """
    weight, slope = float(at.weight), float(at.slope)
    load, required = weight * np.cos(slope), weight * np.sin(slope)
    soil = float(strength.cohesion), float(np.tan(strength.friction_angle))
    rim = float(at.slip), shear_modulus, float(wheel.radius), float(wheel.width)

    def too_far_back(middle: float) -> bool:
        parts = force_components(parabolic_arc(middle, length, 1.0, lean), *rim)
        # NaN where its shear pulls the wheel down
        return not float(pull_under(parts, load, *soil)) <= required

    rear, front = -0.45 * np.pi + 0.5 * length, 0.45 * np.pi - 0.5 * length
    if not rear < front or not too_far_back(rear) or too_far_back(front):
        raise FitError(
            f"no position of an arc of {length:g} rad lets the wheel pull {required:.3g} N at slip "
            f"{float(at.slip):g}"
        )
    for _ in range(HALVINGS):
        middle = 0.5 * (rear + front)
        rear, front = (middle, front) if too_far_back(middle) else (rear, middle)
    parts = force_components(parabolic_arc(front, length, 1.0, lean), *rim)
    return parabolic_arc(front, length, float(magnification(parts, load, *soil)), lean)
