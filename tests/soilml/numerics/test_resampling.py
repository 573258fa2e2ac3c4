"""Resampling, stratification and quantile bands."""

import numpy as np
import pytest

from soilml.numerics.quantiles import quantile_band
from soilml.numerics.resampling import (
    effective_size,
    latin_hypercube,
    systematic_resampling,
    weighted_quantiles,
)


@pytest.mark.parametrize("offset", [0.0, 0.5, 0.99])
def test_each_sample_is_drawn_in_proportion_to_its_weight(offset):
    weights = np.random.default_rng(1).random(500) ** 4
    weights /= weights.sum()
    times = np.bincount(systematic_resampling(weights, 900, offset), minlength=500)
    assert times.sum() == 900
    assert (np.abs(times - 900 * weights) < 1.0).all()


def test_a_latin_hypercube_has_one_point_in_each_stratum():
    points = latin_hypercube(50, 3, np.random.default_rng(2))
    assert (np.sort(np.floor(points * 50), axis=0) == np.arange(50)[:, None]).all()


def test_weighted_quantiles_of_equal_weights_are_those_of_the_values():
    values = np.random.default_rng(3).random((4000, 2))
    found = weighted_quantiles(values, np.full(4000, 1 / 4000), np.asarray([0.05, 0.5]))
    np.testing.assert_allclose(found, np.quantile(values, [0.05, 0.5], axis=0), atol=1e-3)


def test_the_effective_size_counts_equal_weights():
    assert effective_size(np.full(40, 1 / 40)) == pytest.approx(40.0)
    assert effective_size(np.asarray([1.0, 0.0])) == 1.0


def test_a_band_ignores_draws_that_are_not_a_number():
    draws = np.tile(np.arange(101.0)[:, None], (1, 3))
    draws = np.vstack([draws, np.full((20, 3), np.nan)])
    draws[:, 2] = np.nan
    band = quantile_band(draws)
    np.testing.assert_array_equal(band.lower, [5.0, 5.0, np.nan])
    np.testing.assert_array_equal(band.width, [90.0, 90.0, np.nan])
    assert band.middle[0] == 50.0
