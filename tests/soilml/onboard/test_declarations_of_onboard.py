"""What the room declares: constants that were measured with, as the page states them."""

from stated_constants import differences

from soilml.onboard.estimate import Reason
from soilml.onboard.tracking.tracker_state import Event


def test_constants_are_those_of_the_page():
    assert differences("soilml/onboard") == [], "renew: python docs/site/constant_listing.py"


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
