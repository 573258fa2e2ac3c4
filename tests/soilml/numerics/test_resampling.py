"""Resampling, stratification and quantile bands."""

import numpy as np
import pytest

from soilml.numerics.quantiles import (
    quantile_band,
    systematic_resampling,
)


@pytest.mark.parametrize("offset", [0.0, 0.5, 0.99])
def test_each_sample_is_drawn_in_proportion_to_its_weight(offset):
    weights = np.random.default_rng(1).random(500) ** 4
    weights /= weights.sum()
    times = np.bincount(systematic_resampling(weights, 900, offset), minlength=500)
    assert times.sum() == 900
    assert (np.abs(times - 900 * weights) < 1.0).all()


def test_a_band_ignores_draws_that_are_not_a_number():
    draws = np.tile(np.arange(101.0)[:, None], (1, 3))
    draws = np.vstack([draws, np.full((20, 3), np.nan)])
    draws[:, 2] = np.nan
    band = quantile_band(draws)
    np.testing.assert_array_equal(band.lower, [5.0, 5.0, np.nan])
    np.testing.assert_array_equal(band.width, [90.0, 90.0, np.nan])
    assert band.middle[0] == 50.0
