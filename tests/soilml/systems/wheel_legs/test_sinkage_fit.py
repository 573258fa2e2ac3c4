"""The soil from midstance sinkage: found again where it is known, doubted where it is not."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.resistive_force import GROUNDS
from soilml.systems.wheel_legs.sinkage_fit import (
    fit_sinkage,
    simulate_sinkage,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows():
    return simulate_sinkage()


def test_exact_relations_are_recovered():
    z = np.array([0.01, 0.02, 0.03, 0.05])
    found = fit_sinkage(z, 400.0 / z, 0.8 - 6.0 * z, list("abcd"))
    assert found.s_sigma == pytest.approx(400.0)
    assert (found.s_i, found.s_z) == pytest.approx((0.8, -6.0))
    assert found.stiffness_r2 == pytest.approx(1.0) and found.friction_r2 == pytest.approx(1.0)
    assert found.stiffness_scatter == pytest.approx(0.0, abs=1e-9)
    estimate = found(0.02, 0.002)
    assert estimate.normal_stiffness == pytest.approx(20000.0)
    assert estimate.normal_stiffness_std == pytest.approx(2000.0)
    assert estimate.friction_angle_std == pytest.approx(0.012)


def test_soils_left_out_of_the_fit_lie_within_its_uncertainty(rows):
    soils = np.array(rows.soil)
    stiffness_off, friction_off = [], []
    for name in GROUNDS:
        out = soils == name
        kept = (rows.sinkage, rows.normal_stiffness, rows.friction_angle)
        found = fit_sinkage(*(values[~out] for values in kept), soils[~out])(rows.sinkage[out])
        stiffness_off += [
            (rows.normal_stiffness[out] - found.normal_stiffness) / found.normal_stiffness_std
        ]
        friction_off += [
            (rows.friction_angle[out] - found.friction_angle) / found.friction_angle_std
        ]
    assert np.abs(stiffness_off).max() < 3
    assert np.sqrt(np.mean(np.square(stiffness_off))) < 1.5
    assert np.sqrt(np.mean(np.square(friction_off))) < 1.5
