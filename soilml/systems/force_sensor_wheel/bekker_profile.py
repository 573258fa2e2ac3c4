"""Stress profile of the conventional model for a wheel of known sinkage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.errors import InputError
from soilml.parameters import check
from soilml.physics.contact import stress
from soilml.physics.gears import Wheel
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Points of the profile from entry to exit.
POINTS = 201


def bekker_stress_profile(
    wheel: Wheel, soil: Soil, *, slip: float, sinkage: float, rebound: float = 0.0
) -> StressProfile:
    r"""Bekker's normal stress over the visible contact.

    .. math::
        \theta_f = \arccos(1 - h / r), \quad \theta_r = -\arccos(1 - \kappa h / r), \quad
        \theta_m = (a_0 + a_1 s) \theta_f

    `sinkage` is h in m, `rebound` is kappa, the rear contact's height over the sinkage. Raises
    `InputError` for a sinkage or rebound out of range. Under the small wheel that Nagatani et al.
    measured, the true arc is less than half as long (section IV). References: Nagatani et al.
    2009, eqs. 3-7, after Bekker and after Wong and Reece 1967.
    """
    at = Operating(slip=slip, load=1.0)
    check(at)
    check(soil, "soil ")
    check(wheel)
    if not (0.0 < sinkage < wheel.radius and 0.0 <= rebound <= 1.0):
        raise InputError(
            f"sinkage is {sinkage:g} m and rebound {rebound:g}; needed are a sinkage between 0 and "
            f"the radius, {wheel.radius:g} m, and a rebound from 0 to 1"
        )
    depth = np.asarray([sinkage], dtype=np.float64)
    conditions = Operating(slip=np.asarray([slip], dtype=np.float64), load=np.ones(1))
    rim = wheel.contact_geometry(depth, soil, conditions)
    rim = replace(rim, exit=-2.0 * np.arcsin(np.sqrt(rebound * depth / (2.0 * wheel.radius))))
    angle, contact = wheel.profile_contact(rim, conditions, POINTS)
    normal = stress(contact, soil, conditions).normal
    return StressProfile(angle[::-1, 0], normal[::-1, 0])
