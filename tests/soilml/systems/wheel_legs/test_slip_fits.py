"""Slip models fitted to what they, or a simulation, give."""

import numpy as np
import pytest

from soilml.errors import FitError
from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    fit_torque_slip,
    fit_vibration_slip,
)
from soilml.systems.wheel_legs.stances import (
    SLIPS,
    four_soils,
    midstance_torques,
    sample_soils,
)

GRID = [v.ravel() for v in np.meshgrid(np.deg2rad([20.0, 30.0, 40.0]), [700.0, 800.0, 900.0])]
SANDS = sample_soils(12, seed=2)


@pytest.mark.parametrize("name", ["terramechanics", "empirical"])
def test_a_torque_model_is_recovered_from_its_own_values(name):
    law, angle, stiffness = TORQUE_SLIP[name], SANDS.soil.friction_angle, SANDS.normal_stiffness
    a, b = law.line(angle, stiffness)
    torque = (SLIPS[:, None] - a) / b
    fitted = fit_torque_slip(torque, SLIPS, angle, stiffness, name)
    np.testing.assert_allclose(fitted.law.friction, law.friction, atol=1e-9)
    np.testing.assert_allclose(fitted.law.stiffness, law.stiffness, atol=1e-7)
    assert min(fitted.goodness.values()) == pytest.approx(1.0)


def test_a_vibration_model_is_recovered_from_its_own_values():
    law = VIBRATION_SLIP["planar"]
    a, b = law.line(*GRID)
    fitted = fit_vibration_slip((SLIPS[:, None] - a) / b, SLIPS, *GRID, planar=True)
    np.testing.assert_allclose(fitted.law.matrix, law.matrix, atol=1e-9)


def test_a_soil_that_does_not_carry_the_foot_has_no_line():
    known = four_soils()
    heavy = midstance_torques(known, load=36.8)
    assert list(np.isnan(heavy).all(axis=0)) == [True, False, True, False]
    with pytest.raises(FitError, match="2 of 4 soils have no slip model"):
        fit_torque_slip(
            heavy, SLIPS, known.soil.friction_angle, known.normal_stiffness, "terramechanics"
        )
