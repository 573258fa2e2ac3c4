"""Forces that follow from a measured stress, and the two unknowns that balance them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from soilml import ExitAngle, Model, Operating, StressShift, Wheel, soil
from soilml.systems.force_sensor_wheel import (
    MohrCoulomb,
    SensingWheel,
    SteadyRun,
    StressProfile,
    forces_from_profile,
    parabolic_arc,
    solve_force_balance,
)

SENSORS = SensingWheel(noise=0.0)
PHI, TRUE, WEIGHT = math.radians(38.0), 0.0072, 28.92
RIM = {"radius": 0.055, "width": 0.064}


def by_hand(profile, magnification, modulus, cohesion, slip):
    entry, leave = profile.entry_angle, profile.exit_angle

    def stresses(x):
        normal = magnification * np.interp(x, profile.angle, profile.normal)
        j = 0.055 * (entry - x - (1 - slip) * (math.sin(entry) - math.sin(x)))
        strength = cohesion + normal * math.tan(PHI)
        return normal, math.copysign(strength * (1 - math.exp(-abs(j) / modulus)), slip)

    def total(f):
        ends = np.linspace(leave, entry, 41)
        parts = [quad(f, a, b, epsabs=1e-9)[0] for a, b in pairwise(ends)]
        return 0.055 * 0.064 * math.fsum(parts)

    return (
        total(lambda x: stresses(x)[0] * math.cos(x) + stresses(x)[1] * math.sin(x)),
        total(lambda x: stresses(x)[1] * math.cos(x) - stresses(x)[0] * math.sin(x)),
        0.055 * total(lambda x: stresses(x)[1]),
    )


@pytest.mark.parametrize(
    ("cohesion", "slip", "modulus"), [(0.0, 0.11, 0.0072), (800.0, 0.6, 0.001), (0.0, -0.2, 0.003)]
)
def test_forces_are_those_of_dense_quadrature(cohesion, slip, modulus):
    profile = parabolic_arc(0.2, 0.6, 2e4, lean=0.3, points=41)
    found = forces_from_profile(
        profile,
        magnification=1.3,
        shear_modulus=modulus,
        cohesion=cohesion,
        friction_angle=PHI,
        slip=slip,
        **RIM,
    )
    expected = by_hand(profile, 1.3, modulus, cohesion, slip)
    rel = 1e-8 if slip > 0 else 1e-4  # between samples the shear of a braking wheel may turn
    assert (found.load, found.drawbar_pull, found.torque) == pytest.approx(expected, rel=rel)


def test_the_stress_of_the_model_gives_the_forces_of_the_model():
    model = Model(Wheel(**RIM)) + ExitAngle(kappa=0.1) + StressShift(shift=0.3)
    sand, at = soil("nagatani2009/toyoura_sand"), Operating(slip=0.3, load=20.0)
    force, p = model(sand, at), model.profile(sand, at, points=401)
    profile = StressProfile(p.angle[::-1], np.maximum(p.normal[::-1], 0.0))
    found = forces_from_profile(
        profile, shear_modulus=TRUE, friction_angle=sand.friction_angle, slip=0.3, **RIM
    )
    assert float(found.load) == pytest.approx(20.0, rel=1e-3)
    assert float(found.torque) == pytest.approx(float(force.torque), rel=1e-3)
    pulled = SteadyRun(
        slip=0.3,
        weight=math.hypot(20.0, force.drawbar_pull),
        slope=math.atan2(force.drawbar_pull, 20.0),
    )
    back = solve_force_balance(
        profile, pulled, SENSORS, MohrCoulomb(friction_angle=float(sand.friction_angle))
    )
    assert back.shear_modulus == pytest.approx(TRUE, rel=0.02)
