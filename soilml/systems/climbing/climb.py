"""Measurements of a climb: slope, slip and stress of both wheels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.systems.force_sensor_wheel import StressProfile

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class WheelRun:
    """Stress on the rim of a wheel at one slip."""

    slip: float
    profile: StressProfile
    normal_std: Floats = field(default_factory=lambda: np.zeros(0))  # (p,) Pa; empty: no noise

    def __post_init__(self) -> None:
        if len(self.normal_std) == 0:
            object.__setattr__(self, "normal_std", np.zeros(len(self.profile.angle)))


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
#: Smallest difference of slopes that counts, rad: about half a degree.
MIN_SLOPE_DIFFERENCE = 0.009


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
