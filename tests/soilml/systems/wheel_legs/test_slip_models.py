"""The linear slip models: printed matrices, inverses, and units that hang together."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    soil_spring,
)
from soilml.systems.wheel_legs.stances import four_soils

KNOWN = four_soils()
ANGLE, STIFFNESS = KNOWN.soil.friction_angle, KNOWN.normal_stiffness


def test_the_terramechanics_matrix_is_the_printed_one():
    (ct, bt, at), (cs, bs, _) = (
        TORQUE_SLIP["terramechanics"].friction,
        TORQUE_SLIP["terramechanics"].stiffness,
    )
    printed = [[(cs * bt - bs * ct) / (bs * at), 1 / at, -bt / (bs * at)], [-cs / bs, 0, 1 / bs]]
    np.testing.assert_allclose(TORQUE_SLIP["terramechanics"].matrix, printed, atol=1e-12)


def test_the_empirical_matrix_is_the_printed_one():
    law = TORQUE_SLIP["empirical"]
    (ct, bt, _), (cs, bs, a) = law.friction, law.stiffness
    printed = [[(bs * ct - cs * bt) / (a * bt), -bs / (a * bt), 1 / a], [-ct / bt, 1 / bt, 0]]
    np.testing.assert_allclose(law.matrix, printed, atol=1e-12)


@pytest.mark.parametrize("name", ["terramechanics", "empirical"])
def test_a_soil_gives_its_line_and_the_line_its_soil(name):
    law = TORQUE_SLIP[name]
    angle, stiffness = law.soil(*law.line(ANGLE, STIFFNESS))
    np.testing.assert_allclose(angle, ANGLE)
    np.testing.assert_allclose(stiffness, STIFFNESS)


def test_a_spring_gives_its_line_and_the_line_its_spring():
    law = VIBRATION_SLIP["planar"]
    drop, spring = law.spring(*law.line(np.deg2rad([10.0, 30.0]), 900.0))
    np.testing.assert_allclose(np.rad2deg(drop), [10.0, 30.0])
    np.testing.assert_allclose(spring, 900.0)


def test_one_vibration_and_slip_give_the_drop_that_gives_that_slip():
    law = VIBRATION_SLIP["linear"]
    drop = law.drop(3.0, 0.3)
    assert law.slip(3.0, drop, law.assumed) == pytest.approx(0.3)


def test_in_the_units_taken_the_four_soils_slip_as_tested_for_tenths_of_g():
    drop, spring = soil_spring(ANGLE, STIFFNESS)
    assert ((np.rad2deg(drop) > 30) & (np.rad2deg(drop) < 42)).all()
    assert ((spring > 700) & (spring < 1000)).all()
    a, b = VIBRATION_SLIP["planar"].line(drop, spring)
    at_half = (0.5 - a) / b / 9.81  # g, at a slip of 0.5
    assert ((a > -0.2) & (a < 0.25) & (at_half > 0.2) & (at_half < 1.5)).all()
