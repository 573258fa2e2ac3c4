"""What the room declares: constants that were measured with, as the page states them."""

from stated_constants import differences


def test_constants_are_those_of_the_page():
    assert differences("soilml/onboard") == [], "renew: python docs/site/constant_listing.py"
