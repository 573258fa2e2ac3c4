"""The soil from pairs of slip and torque or vibration."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.slip_models import TORQUE_SLIP, VIBRATION_SLIP, soil_spring
from soilml.systems.wheel_legs.soil_from_slip import soil_from_torque, soil_from_vibration

ANGLE, STIFFNESS = 0.7, 1.6e4
SLIPS = np.asarray([0.0, 0.125, 0.25, 0.375, 0.5])


@pytest.mark.parametrize("name", ["terramechanics", "empirical"])
def test_torques_on_the_line_give_the_soil_of_the_line(name):
    a, b = TORQUE_SLIP[name].line(ANGLE, STIFFNESS)
    found = soil_from_torque((SLIPS - a) / b, SLIPS, name)
    assert found.friction_angle == pytest.approx(ANGLE)
    assert found.normal_stiffness == pytest.approx(STIFFNESS)


def test_vibrations_on_the_line_give_the_soil_of_the_line():
    law = VIBRATION_SLIP["planar"]
    a, b = law.line(*soil_spring(ANGLE, STIFFNESS))
    found = soil_from_vibration((SLIPS - a) / b, SLIPS, "planar")
    assert found.friction_angle == pytest.approx(ANGLE)
    assert found.normal_stiffness == pytest.approx(STIFFNESS)


@pytest.mark.parametrize("name", ["empirical", "simplified"])
def test_the_std_from_torque_is_that_of_repeated_tests(name):
    rng, law = np.random.default_rng(3), TORQUE_SLIP[name]
    a, b = law.line(ANGLE, STIFFNESS)
    torque = (SLIPS - a) / b
    errors, claimed = [], []
    for _ in range(400):
        slip = SLIPS + law.slip_std * 0.5 * rng.standard_normal(5)
        quiet = type(law)(
            friction=law.friction, stiffness=law.stiffness, slip_std=0.5 * law.slip_std,
            intercept=law.intercept,
        )  # fmt: skip
        found = soil_from_torque(torque, slip, quiet)
        errors.append(found.friction_angle - ANGLE)
        claimed.append(found.std[0])
    assert np.std(errors) == pytest.approx(np.mean(claimed), rel=0.15)
