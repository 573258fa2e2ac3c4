"""Messages of any content, drawn at random: the node's logic raises nothing and recovers."""

import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ros2_messages import GIVEN, ROOT, SECOND, contents, drive, play

sys.path.insert(0, str(ROOT / "examples" / "ros2"))

from soil_estimator.logic import SoilLogic
from soil_estimator.settings import settings_of

SETTINGS = settings_of(GIVEN)
#: Stamps near each other, and any that a message can hold.
STAMPS = st.one_of(
    st.integers(100 * SECOND, 130 * SECOND), st.integers(-(2**31) * SECOND, 2**31 * SECOND - 1)
)
NUMBERS = st.one_of(st.floats(), st.floats(-2.0, 3.0))
LISTS = st.lists(NUMBERS, max_size=3)
NAMES = st.lists(st.sampled_from(["wheel_joint", "other", ""]), max_size=3)
MESSAGES = st.one_of(
    st.tuples(st.just("joints"), STAMPS, NAMES, LISTS, LISTS),
    st.tuples(st.just("odometry"), STAMPS, NUMBERS, NUMBERS),
    st.tuples(st.just("load"), STAMPS, NUMBERS),
)


@pytest.mark.slow
@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.tuples(st.floats(0.0, 100.0), MESSAGES), max_size=60))
def test_messages_of_any_content_raise_nothing_and_a_sound_drive_follows(messages):
    own = SoilLogic(SETTINGS)
    reports = play(own, messages)
    for report in (*reports, own.inputs(100.0), own.soil()):
        assert "\n" not in report.message and report.level in (0, 1, 2)
    # a sound drive after it, later by the clock
    rows = drive(40, begin=2_000_000_000)
    found = play(own, contents(rows))
    assert len(found) >= 38
    assert found[-1].values["in_range"] == 1.0 and own.inputs(2_000_000_040.0).level == 0
