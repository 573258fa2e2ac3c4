"""How a rover's weight stands on its wheels, found from what they measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.systems.climbing.balance_noise import Shear
from soilml.systems.climbing.climb import Climb
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.wheel_force_parts import parts, shared_magnification


def with_loads(rover: Rover, climbs: Sequence[Climb], shear: Shear) -> Rover:
    r"""The rover with the loads of its wheels, found where it does not know them.

    .. math:: \frac{F_{zf}}{F_{zf} + F_{zr}} = a - h \tan\alpha

    is a straight line through what the front wheels carry in each climb at the soil `shear`, with
    one magnification for both wheels of a run; its slope is taken where three climbs or more span
    0.1 rad, else it is nil. A line of least squares: a and h are then kept in their bounds.
    """
    if rover.knows_loads:
        return rover
    cohesion, friction, modulus = shear
    tangent = np.tan(friction)
    shares = []
    for climb in climbs:
        wheels = parts(climb.front, rover, modulus), parts(climb.rear, rover, modulus)
        shared = shared_magnification(rover, climb.slope, wheels, cohesion, tangent)
        front, rear = (wheel.load(shared, cohesion, tangent) for wheel in wheels)
        shares.append(float(front / (front + rear)))
    steep = np.tan([climb.slope for climb in climbs])
    spans = len(climbs) > 2 and np.ptp(steep) > 0.1
    fall, share = np.polyfit(steep, shares, 1) if spans else (0.0, np.mean(shares))
    return replace(
        rover,
        front_share=float(np.clip(share, 0.05, 0.95)),
        height_ratio=float(np.clip(-fall, 0.0, 2.0)),
    )
