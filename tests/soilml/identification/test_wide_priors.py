"""Priors that are assumed where a parameter has none."""

import pytest

from soilml.fitting.coordinates import _wide_prior
from soilml.parameters import Parameter


def test_a_parameter_without_prior_has_its_bounds_or_decades_about_its_value():
    wide = Parameter("m", 0.0, 1.0, "")
    found = _wide_prior(wide, 0.005)
    assert (found.lower, found.upper) == pytest.approx((0.005 / 30.0, 0.15)) and found.log
    for nominal in (0.0, 0.02):  # within a hundredth of the upper bound
        found = _wide_prior(wide, nominal)
        assert (found.lower, found.upper, found.log) == (0.0, 1.0, False)
