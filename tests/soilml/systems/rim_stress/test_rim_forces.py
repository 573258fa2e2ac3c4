"""Forces that follow from a measured stress, beside dense quadrature and the wheel's model."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from soilml import ExitAngle, Model, Operating, StressShift, Wheel, soil
from soilml.systems.rim_stress import StressProfile
from soilml.systems.rim_stress.force_balance import (
    find_modulus,
    force_components,
    force_of,
    magnification,
    pull_under,
)
from soilml.systems.rim_stress.simulation import parabolic_arc

PHI, TRUE = math.radians(38.0), 0.0072
RIM = (0.055, 0.064)


def by_hand(profile, scale, modulus, cohesion, slip):
    entry, leave = profile.entry_angle, profile.exit_angle

    def stresses(x):
        normal = scale * np.interp(x, profile.angle, profile.normal)
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
    parts = force_components(profile, slip, modulus, *RIM)
    found = [force_of(parts, k, 1.3, cohesion, math.tan(PHI)) for k in range(3)]
    expected = by_hand(profile, 1.3, modulus, cohesion, slip)
    rel = 1e-8 if slip > 0 else 1e-4  # between samples the shear of a braking wheel may turn
    assert found == pytest.approx(expected, rel=rel)


def test_the_stress_of_the_model_gives_the_forces_and_the_modulus_of_the_model():
    model = Model(Wheel(radius=RIM[0], width=RIM[1])) + ExitAngle(kappa=0.1)
    model = model + StressShift(shift=0.3)
    sand, at = soil("nagatani2009/toyoura_sand"), Operating(slip=0.3, load=20.0)
    force, p = model(sand, at), model.profile(sand, at, points=401)
    profile = StressProfile(p.angle[::-1], np.maximum(p.normal[::-1], 0.0))
    tangent = math.tan(sand.friction_angle)
    parts = force_components(profile, 0.3, TRUE, *RIM)
    assert magnification(parts, 20.0, 0.0, tangent) == pytest.approx(1.0, rel=1e-3)
    assert force_of(parts, 2, 1.0, 0.0, tangent) == pytest.approx(float(force.torque), rel=1e-3)

    def pull(modulus):
        return pull_under(force_components(profile, 0.3, modulus, *RIM), 20.0, 0.0, tangent)

    assert find_modulus(pull, float(force.drawbar_pull)) == pytest.approx(TRUE, rel=0.02)
