"""Plate and shear tests of a soil against their formulas."""

import numpy as np
import pytest

from soilml import soil
from soilml.physics.soils.soil_tests import (
    PlatePressure,
    ShearStrength,
    deviation_rates,
    deviations,
)

SAND = soil("wong1989/dry_sand")
PLATE = PlatePressure(plate_width=0.05, sinkage=0.02, pressure=9e3, scatter=0.2)
SHEAR = ShearStrength(normal_stress=8e3, strength=5e3, scatter=0.1)
NAMES = ["cohesion", "friction_angle", "kphi"]


def expected(values):
    """Logarithms of pressure and strength over those measured, in scatters."""
    cohesion, angle, kphi = np.moveaxis(np.asarray(values), -1, 0)
    pressure = (SAND.kc / 0.05 + kphi) * 0.02**SAND.n
    strength = cohesion + 8e3 * np.tan(angle)
    return np.stack([np.log(pressure / 9e3) / 0.2, np.log(strength / 5e3) / 0.1], axis=-1)


def test_deviations_are_logarithms_of_ratios_in_scatters():
    values = np.asarray([[[900.0, 0.5, 1.5e6], [100.0, 0.6, 4e5]]])
    found = deviations([PLATE, SHEAR], SAND, NAMES, values)
    assert found.shape == (1, 2, 2) and found == pytest.approx(expected(values))
    assert deviations([], SAND, NAMES, values).shape == (1, 2, 0)
    own = deviations([PLATE, SHEAR], SAND, [], np.zeros(0))
    known = [float(SAND.cohesion), float(SAND.friction_angle), float(SAND.kphi)]
    assert own == pytest.approx(expected(known))


def test_rates_are_derivatives_of_deviations():
    at, step = np.asarray([900.0, 0.5, 1.5e6]), np.asarray([1.0, 1e-5, 10.0])
    found = deviation_rates([PLATE, SHEAR], SAND, NAMES, at)
    differences = [
        (expected(at + step * np.eye(3)[i]) - expected(at - step * np.eye(3)[i])) / (2.0 * step[i])
        for i in range(3)
    ]
    assert found == pytest.approx(np.stack(differences, axis=1), rel=1e-6, abs=1e-12)
    assert deviation_rates([], SAND, NAMES, at).shape == (0, 3)
    by_n = PLATE.rates({"kc": 0.0, "kphi": 1e6, "n": 1.1})["n"]
    assert by_n == pytest.approx(1e6 * 0.02**1.1 * np.log(0.02))
