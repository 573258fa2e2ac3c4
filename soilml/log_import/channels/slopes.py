"""Slope of the ground from the orientation of a vehicle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def slope_of(columns: Sequence[Floats]) -> Floats:
    """Slope (n,), rad, positive uphill, from one, three or four columns (n,) of an IMU.

    One is the angle itself. Three are accelerations forward, to the left and up, of a vehicle at
    rest or in steady motion, in any unit. Four are a quaternion x, y, z, w of any length, which
    turns axes forward, left and up (REP 103) into those of the world.
    """
    if len(columns) == 1:
        return columns[0]
    if len(columns) == 3:
        forward, left, up = columns
        return np.asarray(np.arctan2(forward, np.hypot(left, up)))
    x, y, z, w = columns
    with np.errstate(invalid="ignore", divide="ignore"):
        rise = 2.0 * (x * z - w * y) / (x**2 + y**2 + z**2 + w**2)
    return np.arcsin(np.clip(rise, -1.0, 1.0))
