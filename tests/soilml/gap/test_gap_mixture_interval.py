"""The interval of a mixture against its own distribution function, and its limits."""

import numpy as np
import pytest
from scipy.stats import norm

from soilml.gap.verdict.estimates import equivalent_std
from soilml.quantities import Z_90


def test_one_component_keeps_its_standard_deviation():
    found = equivalent_std(np.zeros(1), np.full(1, 0.3), np.full(1, 5.0))
    assert found == pytest.approx(0.3, rel=1e-8)


def test_the_interval_covers_90_percent_of_the_mixture():
    offset, std = np.asarray([0.0, 0.7, -2.0]), np.asarray([0.2, 0.5, 0.3])
    weight = np.asarray([6.0, 3.0, 1.5])
    half = Z_90 * equivalent_std(offset, std, weight)
    inside = norm.cdf(half, offset, std) - norm.cdf(-half, offset, std)
    assert weight @ inside / weight.sum() == pytest.approx(0.9, abs=1e-7)


def test_an_unlikely_component_far_away_hardly_widens_it():
    std = np.full(2, 1.0)
    near = equivalent_std(np.asarray([0.0, 0.0]), std, np.asarray([0.97, 0.03]))
    far = equivalent_std(np.asarray([0.0, 100.0]), std, np.asarray([0.97, 0.03]))
    assert near < far < 1.2 * near  # the standard deviation of the mixture is 17
