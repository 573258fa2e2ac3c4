"""Draws are as likely as each other, and an estimate's draws have its mean and covariance."""

import numpy as np
import pytest

from soilml import read_case
from soilml.errors import InputError
from soilml.fitting.coordinates import select_free
from soilml.traction import estimated_draws, prior_draws


@pytest.fixture
def free(model_file):
    return select_free(read_case(model_file), None)


def fractions(free, values):
    low, high = (np.asarray([getattr(f.prior, end) for f in free]) for end in ("lower", "upper"))
    return (values - low) / (high - low)


def test_the_prior_is_drawn_evenly(free):
    u = fractions(free, prior_draws(free, 200).values)
    np.testing.assert_allclose(np.sort(u, axis=0).T, [(np.arange(200) + 0.5) / 200] * 3, atol=0.006)


def test_an_estimate_that_is_the_prior_gives_the_prior(free):
    low, high = (np.asarray([getattr(f.prior, end) for f in free]) for end in ("lower", "upper"))
    draws = estimated_draws(free, (low + high) / 2, np.diag((high - low) ** 2 / 12), 2000)
    shares = np.asarray([0.05, 0.25, 0.5, 0.75, 0.95])
    found = np.quantile(fractions(free, draws.values), shares, axis=0)
    np.testing.assert_allclose(found.T, [shares] * 3, atol=0.03)


@pytest.mark.parametrize(("middle", "wide"), [(0.5, 0.01), (0.5, 0.2), (0.15, 0.12)])
def test_an_estimate_s_draws_have_its_moments(free, middle, wide):
    low, high = (np.asarray([getattr(f.prior, end) for f in free]) for end in ("lower", "upper"))
    mixed = np.asarray([[1.0, -0.8, 0.3], [-0.8, 1.0, 0.0], [0.3, 0.0, 1.0]]) * wide**2
    covariance = mixed * np.outer(high - low, high - low)
    draws = estimated_draws(free, low + middle * (high - low), covariance, 4000)
    u = fractions(free, draws.values)
    assert ((u >= 0.0) & (u <= 1.0)).all()
    np.testing.assert_allclose(u.mean(axis=0), middle, atol=0.08 * wide)
    np.testing.assert_allclose(np.cov(u.T), mixed, atol=0.1 * wide**2)


def test_an_estimate_that_is_none_is_refused(free):
    mean = np.asarray([1500.0, 0.6, 0.015])
    with pytest.raises(InputError, match="covariance"):
        estimated_draws(free, mean, np.zeros((3, 3)))
    with pytest.raises(InputError, match="friction_angle lies outside"):
        estimated_draws(free, mean * [1.0, 2.0, 1.0], np.diag([100.0, 0.01, 0.001]) ** 2)
