"""Distribution of a rover's weight over its wheels, estimated from the measured stresses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.systems.climbing.climb import Climb, Rover
from soilml.systems.climbing.climb_balances import ShearParameters
from soilml.systems.climbing.wheel_force_components import force_components, shared_magnification

#: Smallest range of tan(slope) from which the height of the centre of mass is estimated.
MIN_SPAN = 0.1


def estimate_wheel_loads(rover: Rover, climbs: Sequence[Climb], shear: ShearParameters) -> Rover:
    r"""The rover with its centre of mass estimated from the climbs if it is unknown.

    .. math:: \frac{F_{zf}}{F_{zf} + F_{zr}} = a - h \tan\alpha

    is fitted by least squares to the front wheels' share of the load in each climb at the soil
    `shear`, with one magnification for both wheels of a run. h is estimated if three climbs or more
    span 0.1 in tan(alpha), and is 0 otherwise; a and h are limited to their bounds.
    """
    if rover.has_known_loads:
        return rover
    cohesion, friction, modulus = shear
    tan_friction = np.tan(friction)
    shares = []
    for climb in climbs:
        wheels = (
            force_components(climb.front, rover, modulus),
            force_components(climb.rear, rover, modulus),
        )
        shared = shared_magnification(rover, climb.slope, wheels, cohesion, tan_friction)
        front, rear = (wheel.load(shared, cohesion, tan_friction) for wheel in wheels)
        shares.append(float(front / (front + rear)))
    gradient = np.tan([climb.slope for climb in climbs])
    spans = len(climbs) > 2 and np.ptp(gradient) > MIN_SPAN
    fall, share = np.polyfit(gradient, shares, 1) if spans else (0.0, np.mean(shares))
    return replace(
        rover,
        front_share=float(np.clip(share, 0.05, 0.95)),
        height_ratio=float(np.clip(-fall, 0.0, 2.0)),
    )
