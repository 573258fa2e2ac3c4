"""What the room declares: numbers that logs hold."""

from soilml.onboard.estimate import Reason
from soilml.onboard.tracking.soil_tracker import Event


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
