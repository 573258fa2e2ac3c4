"""Quantities passed between the stages of the wheel model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WheelState:
    """Wheel, soil and operating point of a batch; every field is an array (n,), in SI."""

    slip: Floats
    load: Floats  # N
    radius: Floats  # m
    width: Floats  # m
    cohesion: Floats  # Pa
    friction_angle: Floats  # rad
    shear_modulus: Floats  # m
    kc: Floats  # N/m^(n+1)
    kphi: Floats  # N/m^(n+2)
    n: Floats
    a0: Floats
    a1: Floats
    unit_weight: Floats  # N/m^3
    speed: Floats  # m/s
    pass_number: Floats
    slip_angle: Floats  # rad

    @property
    def travel_ratio(self) -> Floats:
        """Distance travelled over distance rolled, v / (r omega), (n,).

        Slip is s = 1 - v / (r omega) when driving and s = r omega / v - 1 when braking.
        """
        with np.errstate(divide="ignore"):
            return np.where(self.slip < 0.0, 1.0 / (1.0 + self.slip), 1.0 - self.slip)


@dataclass(frozen=True)
class ContactArc:
    """The part of the rim that touches the soil; arrays (n,), angles from straight down, rad."""

    entry: Floats
    exit: Floats
    peak: Floats
    sinkage: Floats  # m
    radius: Floats  # m, of the circle in contact with the soil
    shear_radius: Floats  # m
    lever: Floats  # m


@dataclass(frozen=True)
class ContactPoints:
    """Stresses (Pa) at points of the arc; arrays (points, n)."""

    theta: Floats  # rad
    angle_from_entry: Floats  # rad, entry angle less theta
    depth: Floats  # m, that sets the pressure
    shear_displacement: Floats  # m, shear displacement
    normal: Floats
    strength: Floats  # c + sigma tan(phi)
    shear: Floats


@dataclass(frozen=True)
class SoilReaction:
    """Load carried (N), drawbar pull (N), torque (N m) and sinkage (m); arrays (n,).

    NaN where the soil does not carry the load at any sinkage down to the hub.
    """

    load: Floats
    pull: Floats
    torque: Floats
    sinkage: Floats
