"""The numbers that Nagatani, Ikeda, Sato and Yoshida 2009 print, computed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from soilml.physics.effects import StressShift
from soilml.physics.gears import Wheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating
from soilml.physics.soils import soil
from soilml.systems.rim_stress import (
    SensingWheel,
    SteadyRun,
    StressProfile,
    balanced_arc,
    bin_stress,
    simulate_readings,
)
from soilml.systems.rim_stress.force_balance import WheelBalance
from soilml.systems.rim_stress.stress import deconvolve

#: Table I pairs its five slips with the five slopes of section IV.A, in order.
SLOPES = {0.11: 0.0, 0.18: 2.0, 0.29: 4.0, 0.39: 6.0, 0.80: 8.0}
#: Shift of the exit towards the entry that leaves 30 of 70 degrees, rounded as in the effect.
SHIFT = 0.57
WHEEL, SAND = SensingWheel(noise=0.0), soil("nagatani2009/toyoura_sand")
WEIGHT = 28.92
#: Fields of the wheel that the paper prints.
SENSORS = (
    *("radius", "width", "sensors", "diameter"),
    *("interval", "rim_speed", "saturation", "deadband"),
)


@cache
def _through_sensors(slip: float) -> tuple[StressProfile, float]:
    """Stress and k_x (m) estimated through the sensors from an arc of 30 degrees with one k_x."""
    at = SteadyRun(slip=slip, weight=WEIGHT, slope=math.radians(SLOPES[slip]))
    true = balanced_arc(math.radians(30.0), at, WHEEL, SAND)
    profile = deconvolve(bin_stress(simulate_readings(true, WHEEL), WHEEL), WHEEL)
    return profile, WheelBalance.of(WHEEL, SAND).modulus(profile, at)


def _arc() -> float:
    """Length of the stressed arc in degrees, mean over the runs up to slip 0.5."""
    profiles = [_through_sensors(slip)[0] for slip in SLOPES if slip < 0.5]
    return float(np.rad2deg(np.mean([p.entry_angle - p.exit_angle for p in profiles])))


def _shifted_arc() -> float:
    """Length of the arc in degrees that remains of 70 degrees with `stress-shift`."""
    wheel, at = Wheel(radius=WHEEL.radius, width=WHEEL.width), Operating(slip=0.0, load=WEIGHT)
    depth = np.asarray(WHEEL.radius * (1.0 - math.cos(math.radians(70.0))))
    scene = LoadCase(wheel, SAND, at)
    rim = wheel.contact_geometry(depth, SAND, at)
    shifted = StressShift(shift=SHIFT).on_contact(rim, scene)
    return float(np.rad2deg(shifted.entry - shifted.exit))


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    **{name: partial(getattr, SensingWheel(), name) for name in SENSORS},
    "weight": lambda: WEIGHT,
    "cohesion": lambda: float(SAND.cohesion),
    "friction_angle": lambda: math.degrees(SAND.friction_angle),
    "modulus_flat": lambda: float(SAND.shear_modulus),
    "arc": _arc,
    "arc_effect": _shifted_arc,
    # at the slips between, a comparison would be of two printed numbers
    "modulus_11": lambda: _through_sensors(0.11)[1],
    "modulus_80": lambda: _through_sensors(0.80)[1],
}
