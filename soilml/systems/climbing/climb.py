"""What was measured on a climb: slope, slip and stress of both wheels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.systems.force_sensor_wheel import StressProfile

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class WheelRun:
    """A wheel at one slip, and the stress on its rim."""

    slip: float
    profile: StressProfile
    normal_std: Floats = field(default_factory=lambda: np.zeros(0))  # (p,) Pa; empty: exact

    def __post_init__(self) -> None:
        if len(self.normal_std) == 0:
            object.__setattr__(self, "normal_std", np.zeros(len(self.profile.angle)))


@dataclass(frozen=True)
class Climb:
    """A steady climb straight up a slope; the wheels of both sides do the same."""

    name: str
    slope: float  # rad
    front: WheelRun
    rear: WheelRun

    @property
    def wheels(self) -> tuple[WheelRun, WheelRun]:
        """Front and rear."""
        return self.front, self.rear

    def with_speed_error(self, share: float) -> Climb:
        """The same climb, had the speed been read too high by this share: slips lower."""
        front, rear = (replace(w, slip=1.0 - (1.0 - w.slip) * (1.0 + share)) for w in self.wheels)
        return replace(self, front=front, rear=rear)


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Standard deviations of what is measured on a climb.

    `speed` is the share by which the speed of each run is off on its own, `speed_scale` that by
    which all are off alike; both wheels of a rover have its speed. `entry_angle` is how far all
    are off alike, by the sensors' size, sampling and deadband. `front_load` is the share by which
    the load of the front wheels is off, or, where it is not known, the share by which the front
    wheels' magnification differs from the rear's.
    """

    speed: float = 0.0087  # within 1.5 %, evenly
    speed_scale: float = 0.0
    slope: float = 0.005  # rad
    entry_angle: float = 0.005  # rad, about half a sample
    front_load: float = 0.05


def conditions(climbs: Sequence[Climb], slope_std: float) -> list[list[int]]:
    """Climbs grouped by slope: neighbours that noise alone could set apart are one condition."""
    order = np.argsort([climb.slope for climb in climbs], kind="stable")
    apart = max(3.0 * np.sqrt(2.0) * slope_std, 0.009)
    groups = [[int(order[0])]]
    for i in order[1:]:
        if climbs[i].slope - climbs[groups[-1][0]].slope > apart:
            groups.append([])
        groups[-1].append(int(i))
    return groups
