"""What legs and feet do to sinkage and slip (Comin and Saaj 2017, figs. 5 and 6)."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.gait_metrics import (
    compare_feet,
    compare_legs,
    decreasing_until,
)
from soilml.systems.wheel_legs.resistive_force import LinearGround

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def legs():
    return compare_legs(LinearGround(stiffness=0.7e6))


@pytest.fixture(scope="module")
def feet():
    return compare_feet()


def test_every_leg_added_up_to_five_lowers_the_slip(legs):
    assert decreasing_until(legs.rms_slip) >= 5


def test_up_to_four_legs_the_mean_square_of_sinkage_grows_with_the_time_on_the_ground(legs):
    assert np.all(np.diff(legs.rms_sinkage[:4]) > 0)
    assert legs.rms_sinkage[4] < legs.rms_sinkage[3]


def test_the_largest_foot_slips_least_and_none_most(feet):
    none, ltf, srf, cif = feet.slip
    assert np.all(cif < np.minimum(ltf, srf)) and np.all(none > np.maximum(ltf, srf))
