"""Inputs of a model, and numbers that logs contain."""

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.onboard.estimate import Reason
from soilml.onboard.features import as_numbers, parts_of_rows
from soilml.onboard.tracking.soil_tracker import Event


@pytest.mark.parametrize(("count", "sizes"), [(0, [0]), (4, [4]), (5, [4, 1]), (8, [4, 4])])
def test_rows_are_fed_in_parts(count, sizes):
    rows = {"slip": np.arange(count), "load": -np.arange(count)}
    parts = list(parts_of_rows(rows, 4))
    assert [len(part["slip"]) for part in parts] == sizes
    for name, values in rows.items():
        assert np.concatenate([part[name] for part in parts]).tolist() == values.tolist()


def test_a_wrong_argument_is_shown_in_forty_characters():
    with pytest.raises(InputError, match=r"^slip is 'a{39}\.\.\.; needed is a number") as raised:
        as_numbers("slip", "a" * 9000)
    assert len(str(raised.value)) < 100
    with pytest.raises(InputError, match=r"^slip is 'much'; needed"):
        as_numbers("slip", "much")


def test_numbers_of_flags_and_events_stay():
    """A rover's log holds the numbers: they are never reused."""
    assert {event.name: event.value for event in Event} == {
        "ACCEPTED": 0,
        "SET_ASIDE": 1,
        "SOIL_CHANGED": 2,
        "DRIFT": 3,
        "STUCK": 4,
        "REPEATED": 5,
        "UNUSABLE": 6,
    }
    assert {reason.name: reason.value for reason in Reason} == {
        "ESTIMATED": 0,
        "OUT_OF_RANGE": 1,
        "INCONSISTENT": 2,
        "NO_INFORMATION": 3,
        "CONTRADICTORY": 4,
    }
