"""Slip of a wheel from its speed and that of the rover."""

from __future__ import annotations


def slip_of(rim_speed: float, speed: float) -> float:
    """Slip from the speed of the rim (m/s) and of the rover (m/s), both forward and above zero.

    Driving, `1 - v / (r omega)`; braking, `r omega / v - 1`, which is negative.
    """
    if speed <= rim_speed:
        return 1.0 - speed / rim_speed
    return rim_speed / speed - 1.0
