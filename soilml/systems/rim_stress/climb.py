"""A rover on four wheels, its climbs of slopes, and the uncertainty of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, final

import numpy as np

from soilml.arrays import Floats, Real
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.systems.rim_stress.stress_profile import StressProfile

#: Cohesion (Pa), friction angle (rad), shear modulus (m).
ShearParameters = tuple[float, float, float]
WHEELS = ("front", "rear")  # The wheels of one side; both sides carry and pull equally


@final
@dataclass(frozen=True, kw_only=True)
class Rover:
    """Two front and two rear wheels of equal size; the centre of mass may be unknown.

    If `front_share` and `height_ratio` are known, so is the load of each wheel, and each wheel has
    a magnification of its own. Otherwise both wheels of a run share one.

    Parameters
    ----------
    mass
        Mass of the rover, kg.
    radius, width
        Of a wheel, m.
    gravity
        m/s^2.
    front_share
        Fraction of the weight on the front wheels on level ground.
    height_ratio
        Height of the centre of mass over the wheelbase.
    """

    mass: Annotated[float, Parameter("kg", 0.01, 1e5, "mass of the whole rover")]
    radius: Annotated[float, Parameter("m", 0.005, 5.0, "wheel radius")]
    width: Annotated[float, Parameter("m", 0.002, 5.0, "wheel width")]
    gravity: Annotated[float, Parameter("m/s^2", 0.01, 30.0, "gravity")] = 9.80665
    front_share: Annotated[
        float | None, Parameter("1", 0.05, 0.95, "share of the weight on the front wheels, flat")
    ] = None
    height_ratio: Annotated[
        float | None, Parameter("1", 0.0, 2.0, "height of the centre of mass over the wheelbase")
    ] = None

    def __post_init__(self) -> None:
        if (self.front_share is None) != (self.height_ratio is None):
            raise InputError(
                "front_share and height_ratio belong together: give both, or neither where the "
                "centre of mass is not known"
            )

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * self.gravity

    @property
    def has_known_loads(self) -> bool:
        """Whether the load of each wheel follows from the slope alone."""
        return self.front_share is not None

    def loads(self, slope: Real) -> tuple[Real, Real]:
        r"""Load perpendicular to the slope on one front and one rear wheel, N.

        .. math::
            F_{zf} = \tfrac12 m g (a \cos\alpha - h \sin\alpha), \quad
            F_{zr} = \tfrac12 m g ((1 - a) \cos\alpha + h \sin\alpha)

        with a the front share on level ground and h the height of the centre of mass over the
        wheelbase: balance of moments about the wheel contacts at constant speed. The offset of
        the wheel forces from the axle is neglected.
        """
        if self.front_share is None or self.height_ratio is None:
            raise InputError("the loads of the wheels need front_share and height_ratio")
        half = 0.5 * self.weight
        across, along = np.cos(slope), np.sin(slope)
        front = half * (self.front_share * across - self.height_ratio * along)
        rear = half * ((1.0 - self.front_share) * across + self.height_ratio * along)
        return front, rear


@dataclass(frozen=True)
class WheelRun:
    """Stress on the rim of a wheel at one slip."""

    slip: float
    profile: StressProfile
    normal_std: Floats = field(default_factory=lambda: np.zeros(0))  # (p,) Pa; empty: no noise

    def __post_init__(self) -> None:
        if len(self.normal_std) == 0:
            object.__setattr__(self, "normal_std", np.zeros(len(self.profile.angle)))

    def with_entry(self, shift: float) -> WheelRun:
        """The wheel with its entry angle moved forward by `shift` (rad), the stress unchanged."""
        profile = self.profile
        kept = profile.angle < profile.entry_angle
        angle = np.append(profile.angle[kept], profile.entry_angle + shift)
        normal = np.append(profile.normal[kept], 0.0)
        return WheelRun(self.slip, StressProfile(angle, normal))


@dataclass(frozen=True)
class Climb:
    """A steady climb straight up a slope; the wheels of both sides behave equally."""

    name: str
    slope: float  # rad
    front: WheelRun
    rear: WheelRun

    @property
    def wheels(self) -> tuple[WheelRun, WheelRun]:
        """Front and rear."""
        return self.front, self.rear

    def with_speed_error(self, share: float) -> Climb:
        """The climb as measured with a speed too high by this fraction, and slips thus too low."""
        front, rear = (replace(w, slip=1.0 - (1.0 - w.slip) * (1.0 + share)) for w in self.wheels)
        return replace(self, front=front, rear=rear)


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Standard deviations of the measurements on a climb.

    `speed` is the relative error of the speed of each run, `speed_scale` a relative error common to
    all runs; both wheels of a rover have its speed. `entry_angle` is an error common to all runs,
    due to size, sampling and deadband of the sensors. `front_load` is the relative error of the
    load on the front wheels or, where that load is not known, the relative difference between the
    magnifications of front and rear wheels.
    """

    speed: float = 0.0087  # uniform within 1.5 %
    speed_scale: float = 0.0
    slope: float = 0.005  # rad
    entry_angle: float = 0.005  # rad, about half a sample
    front_load: float = 0.05


#: Slopes that differ by less than this many standard deviations of a difference are one condition.
SLOPE_SIGMAS = 3.0
MIN_SLOPE_DIFFERENCE = 0.009  # Smallest difference of slopes that counts, rad: about half a degree


def group_by_slope(climbs: Sequence[Climb], slope_std: float) -> list[list[int]]:
    """Indices of the climbs grouped by slope; slopes that differ by noise alone are one group."""
    order = np.argsort([climb.slope for climb in climbs], kind="stable")
    tolerance = max(SLOPE_SIGMAS * np.sqrt(2.0) * slope_std, MIN_SLOPE_DIFFERENCE)
    groups = [[int(order[0])]]
    for i in order[1:]:
        if climbs[i].slope - climbs[groups[-1][0]].slope > tolerance:
            groups.append([])
        groups[-1].append(int(i))
    return groups
