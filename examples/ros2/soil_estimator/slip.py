"""Slip of a wheel from its speed and that of the rover."""

from __future__ import annotations


def slip_of(rim_speed: float, speed: float) -> float:
    """Slip from the speed of the rim (m/s, above zero) and of the axle over ground (m/s).

    Driving, `1 - v / (r omega)`, which is above 1 where the axle moves backward; braking,
    `r omega / v - 1`, which is negative. Source: Wong (2008), Theory of Ground Vehicles, section
    1.1 for driving and 1.2 for braking.
    """
    if speed <= rim_speed:
        return 1.0 - speed / rim_speed
    return rim_speed / speed - 1.0
