"""What legs and feet do to sinkage and slip (Comin and Saaj 2017, figs. 5 and 6)."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.gait_metrics import (
    compare_feet,
    compare_legs,
    decreasing_until,
    gait_metrics,
)
from soilml.systems.wheel_legs.geometry import wheel_leg
from soilml.systems.wheel_legs.resistive_force import LinearGround
from soilml.systems.wheel_legs.walk import walk

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def legs():
    return compare_legs(LinearGround(stiffness=0.7e6))


@pytest.fixture(scope="module")
def feet():
    return compare_feet()


def test_every_leg_added_up_to_five_lowers_the_slip(legs):
    assert decreasing_until(legs.rms_slip) >= 5


def test_the_body_lies_on_the_ground_until_a_fifth_leg_lifts_it(legs):
    assert np.ptp(legs.max_sinkage[:4]) < 0.01 * legs.max_sinkage[0]
    assert legs.max_sinkage[4] < 0.9 * legs.max_sinkage[3]


def test_up_to_four_legs_the_mean_square_of_sinkage_grows_with_the_time_on_the_ground(legs):
    assert np.all(np.diff(legs.rms_sinkage[:4]) > 0)
    assert legs.rms_sinkage[4] < legs.rms_sinkage[3]


def test_one_leg_slips_less_while_it_propels(legs):
    assert legs.rms_slip_propelled[0] < 0.8 * legs.rms_slip[0]
    np.testing.assert_array_equal(legs.rms_slip_propelled[2:], legs.rms_slip[2:])


def test_any_foot_sinks_less_than_none_and_the_largest_least(feet):
    none, ltf, srf, cif = feet.sinkage
    assert np.all(none > ltf) and np.all(none > srf)
    assert np.all(cif < 0.5 * np.minimum(ltf, srf))


def test_the_largest_foot_slips_least_and_none_most(feet):
    none, ltf, srf, cif = feet.slip
    assert np.all(cif < np.minimum(ltf, srf)) and np.all(none > np.maximum(ltf, srf))


def test_sinkage_is_most_sensitive_to_stiffness_with_the_load_testing_foot(feet):
    slope, _ = feet.sensitivity(feet.sinkage)
    assert np.all(slope < 0)
    assert feet.feet[np.argmin(slope)] == "LTF" and feet.feet[np.argmax(slope)] == "CIF"


def test_slip_is_most_sensitive_to_stiffness_without_a_foot(feet):
    slope, error = feet.sensitivity(feet.slip)
    assert [feet.feet[i] for i in np.argsort(slope)] == ["none", "LTF", "SRF", "CIF"]
    assert np.all(error > 0)


def test_a_stopped_walk_has_no_metrics():
    stopped = gait_metrics(walk(wheel_leg("LTF"), LinearGround(stiffness=10.0)))
    assert stopped.status[0] != 0
    figures = [v for name, v in vars(stopped).items() if name != "status"]
    assert np.isnan(figures).all()
