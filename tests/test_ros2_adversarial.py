"""Messages of any content, drawn at random: the node's logic raises nothing and recovers."""

import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ros2_messages import GIVEN, LOAD, RADIUS, ROOT, SECOND, contents, drive, play

sys.path.insert(0, str(ROOT / "examples" / "ros2"))

from soil_estimator.logic import SoilLogic
from soil_estimator.rows import RowCollector
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


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.data())
def test_late_topics_give_the_rows_of_prompt_ones(data):
    """Each topic keeps its order; waits are drawn for every message, below the patience."""
    ready, mixed = {"joints": 0.0, "odometry": 0.0}, []
    for at, (kind, *parts) in contents(drive(12, rate=8)):
        wait = data.draw(st.floats(0.0, 0.9))
        ready[kind] = max(ready[kind], at + wait)
        mixed.append((ready[kind], (kind, *parts)))
    mixed.sort(key=lambda each: each[0])

    def rows_of(messages):
        rows, found = RowCollector(RADIUS, LOAD), []
        for _, (kind, stamp, *parts) in messages:
            joint = (
                {"wheel_speed": parts[1][-1], "torque": parts[2][-1]} if kind == "joints" else {}
            )
            found += rows.add(stamp, joint or {"speed": parts[0]})
        return found

    assert rows_of(mixed) == rows_of(contents(drive(12, rate=8)))
