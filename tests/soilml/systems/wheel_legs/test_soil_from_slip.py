"""The soil from pairs of slip and torque or vibration."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.slip_models import TORQUE_SLIP, VIBRATION_SLIP, soil_spring
from soilml.systems.wheel_legs.soil_from_slip import soil_from_torque, soil_from_vibration
from soilml.systems.wheel_legs.soil_of_strides import soil_of_strides

ANGLE, STIFFNESS = 0.7, 1.6e4
#: Mean errors of the friction angle on the four soils by torque, vibration and sinkage.
TABLE_VIII = 0.01 * np.asarray([[-7, -9, 21, 4], [1, 3, 5, 23], [-17, -8, 4, 2]])
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


def test_more_pairs_reduce_the_error_of_strides_and_not_that_of_the_soil():
    one = soil_from_torque(1.0, 0.2)
    many = soil_from_torque(np.full(4, 1.0), np.full(4, 0.2))
    assert many.shared == pytest.approx(one.shared)
    assert many.covariance - many.shared == pytest.approx((one.covariance - one.shared) / 4)


@pytest.mark.parametrize("strides", [3, 60])
def test_intervals_cover_soils_whose_errors_are_of_the_size_of_table_viii(strides):
    """Sensors err by a share of their own on each soil, and their slip in each stride.

    Above an angle of 0.75 the printed relation of vibration is singular: no sensor is to see that.
    """
    rng, inside = np.random.default_rng(strides), []
    shear, spring = TORQUE_SLIP["simplified"], VIBRATION_SLIP["linear"]
    for _ in range(1000):
        angle, slip = rng.uniform(0.5, 0.58), rng.uniform(0.05, 0.45, strides)
        shares = 0.5 * TABLE_VIII @ rng.standard_normal(4)  # second moments are those of its soils
        by_torque, by_vibration, by_sinkage = angle * (1.0 + shares)
        noise = rng.standard_normal((2, strides))
        drop = np.deg2rad((by_vibration + 0.76 - 0.35e-3 * spring.assumed) / 0.03)
        a, b = spring.line(drop, spring.assumed)
        readings = {
            "torque": (slip + shear.slip_std * noise[0] + 0.33) / ((by_torque - 1.0) / -0.58),
            "vibration": (slip + spring.slip_std * noise[1] - a) / b,
            "sinkage": np.full(strides, max((by_sinkage - 0.76) / -7.0, 1e-3)),
        }
        found = soil_of_strides(slip, readings)
        inside.append(np.abs(found.mean[:, 0] - angle) < 1.645 * found.std[:, 0])
    covered = dict(zip((*readings, "fused"), np.mean(inside, axis=0), strict=True))
    assert all(0.85 < share < 0.95 for share in covered.values()), covered
