"""Importance sampling, resampling, and bands of quantiles."""

import numpy as np
import pytest

from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.quantiles import (
    quantile_band,
    systematic_resampling,
)


def middle(p, std):
    """A normal density about the middle of the cube."""
    return np.full(p, 0.5), std * np.eye(p)


def test_samples_drawn_about_the_middle_have_the_moments_of_a_density_of_many_dimensions():
    """Nine dimensions, in which a Latin hypercube has hardly a point where the density is."""
    p, std = 9, 0.03
    mean = 0.5 + std * np.linspace(-1.0, 1.0, p)

    def log_density(u):
        return -0.5 * (((u - mean) / std) ** 2).sum(axis=1)

    found = importance_sample(log_density, p, least_effective_size=1500.0, around=middle(p, 0.045))
    assert found.effective_size >= 1500.0
    assert len(found.u) <= 5 * 2048  # a few rounds
    assert (found.mean(found.u) - mean) / std == pytest.approx(0.0, abs=0.15)
    spread = np.sqrt(found.mean((found.u - mean) ** 2))
    assert spread == pytest.approx(std, rel=0.1)
    assert found.evidence == pytest.approx(p * np.log(np.sqrt(2.0 * np.pi) * std), abs=0.1)


def test_few_samples_for_each_component_do_not_cost_the_tails():
    """Nine dimensions, of which the first scales the spread of the others."""
    p, width, rate = 9, 1.0 / 12.0, 0.35

    def log_density(u):
        z = (u - 0.5) / width
        squares = (z[:, 1:] ** 2).sum(axis=1) * np.exp(-2.0 * rate * z[:, 0])
        return -0.5 * (z[:, 0] ** 2 + squares) - (p - 1) * rate * z[:, 0]

    expected = np.append(1.0, np.full(p - 1, np.exp(rate**2)))
    ratios = []
    for seed in range(10):
        found = importance_sample(
            log_density, p, seed, least_effective_size=1250.0, around=middle(p, width)
        )
        spread = np.sqrt(found.mean((found.u - found.mean(found.u)) ** 2))
        ratios.append(spread / width / expected)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.022)


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
