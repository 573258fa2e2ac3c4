"""Stress of the ground on every plate of a wheel-leg at one instant of its walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.geometry import WheelLeg
from soilml.systems.wheel_legs.ground_reaction import SKIN, batch_plates
from soilml.systems.wheel_legs.integrator import FADING
from soilml.systems.wheel_legs.resistive_force import LinearGround, resistance
from soilml.systems.wheel_legs.walk import Walk


@dataclass(frozen=True)
class PlateStress:
    """Positions of the plates (m, x along the walk, z up from the surface) and their stress (Pa).

    Arrays (plates,), ordered by leg (leg, tip, heel), with the body last. `ahead` and `up` are the
    components of the stress on the plate, 0 above the ground.
    """

    x: Array
    z: Array
    ahead: Array
    up: Array
    area: Array  # m^2


def plate_stresses(
    walked: Walk, instant: int, wheel: WheelLeg, ground: LinearGround, case: int = 0
) -> PlateStress:
    """Stress on every plate at an instant of a case of a walk (Comin and Saaj 2017, eq. 4)."""
    plates = batch_plates([wheel], [ground])
    pose = plates.at(float(walked.angle[instant]))
    x, z, vx, vz = (
        float(part[instant, case]) for part in (walked.x, walked.z, walked.vx, walked.vz)
    )
    turning = plates.speed * plates.turns
    across, upwards = vx + turning * pose.z, vz - turning * pose.x
    fading = FADING * wheel.speed * wheel.leg.length
    pace = np.sqrt(across**2 + upwards**2 + fading**2)
    sx, sz = resistance(pose.c2, pose.s2, across / pace, upwards / pace)
    depth = np.maximum(-(z + pose.z), 0.0)
    pressure = ground.stiffness * depth + ground.offset * (1.0 - np.exp(-depth / SKIN))
    parts = (x + pose.x, z + pose.z, pressure * sx, pressure * sz, plates.area)
    return PlateStress(*(part[:, 0] for part in parts))
