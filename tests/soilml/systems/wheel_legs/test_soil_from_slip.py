"""The soil from pairs of slip and torque or vibration."""

import numpy as np
import pytest

from soilml.errors import FitError, InputError
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


def test_one_torque_is_enough_for_the_simplified_model_alone():
    torque = (0.25 + 0.33) / TORQUE_SLIP["simplified"].line(ANGLE, STIFFNESS)[1]
    assert soil_from_torque(torque, 0.25).friction_angle == pytest.approx(ANGLE)
    with pytest.raises(FitError, match="needs two or more with different slips; the simplified"):
        soil_from_torque(torque, 0.25, "empirical")


def test_one_vibration_is_enough_for_the_linear_model_alone():
    drop = VIBRATION_SLIP["linear"].drop(2.0, 0.25)
    found = soil_from_vibration(2.0, 0.25)
    expected = -0.76 + 0.35 * VIBRATION_SLIP["linear"].assumed / 1e3 + 0.03 * np.rad2deg(drop)
    assert found.friction_angle == pytest.approx(expected)
    with pytest.raises(FitError, match="the linear model needs one"):
        soil_from_vibration(2.0, 0.25, "planar")


def test_vibrations_on_the_line_give_the_soil_of_the_line():
    law = VIBRATION_SLIP["planar"]
    a, b = law.line(*soil_spring(ANGLE, STIFFNESS))
    found = soil_from_vibration((SLIPS - a) / b, SLIPS, "planar")
    assert found.friction_angle == pytest.approx(ANGLE)
    assert found.normal_stiffness == pytest.approx(STIFFNESS)


def test_slips_that_hardly_differ_cannot_make_a_line():
    with pytest.raises(FitError, match=r"the slips have a range of 0\.02"):
        soil_from_torque([1.0, 1.1], [0.2, 0.22], "empirical")


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


def test_the_std_from_vibration_is_that_of_repeated_tests():
    rng, law = np.random.default_rng(4), VIBRATION_SLIP["linear"]
    slip = law.slip(2.0, np.deg2rad(38.0), 1.0) + 0.5 * law.slip_std * rng.standard_normal(2000)
    drawn = [soil_from_vibration(2.0, s) for s in slip]
    errors = np.std([d.friction_angle for d in drawn])
    assert errors == pytest.approx(0.5 * drawn[0].std[0], rel=0.1)


def test_invalid_pairs_are_refused():
    with pytest.raises(InputError, match="2 values of torque and 1 slips"):
        soil_from_torque([1.0, 2.0], [0.1])
    with pytest.raises(InputError, match="is not a number"):
        soil_from_vibration([np.nan], [0.1])
    with pytest.raises(InputError, match="there are: terramechanics"):
        soil_from_torque(1.0, 0.1, "magic")
    with pytest.raises(FitError, match="torque of zero"):
        soil_from_torque(0.0, 0.1)
    with pytest.raises(InputError, match="slip is 20; it must lie between -1 and 1"):
        soil_from_torque(1.0, 20.0)
    with pytest.raises(InputError, match="torque_std is nan"):
        soil_from_torque(1.0, 0.2, torque_std=np.nan)


@pytest.mark.parametrize(("torque", "slip"), [(1e9, 0.2), (-1.0, 0.2), (1.0, -0.9)])
def test_an_unphysical_estimate_is_refused(torque, slip):
    with pytest.raises(FitError, match="which is not physical"):
        soil_from_torque(torque, slip)
