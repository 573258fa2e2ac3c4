"""Scores of a file against the exact posterior, on estimates whose scores are known."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from set_comparison import (
    GaussianEstimates,
    PosteriorComparison,
)


def comparison(n=4000, error=0.0, width=1.0, seed=0):
    """A normal posterior of three parameters, and a file with an error of its mean and width."""
    rng = np.random.default_rng(seed)
    std = np.asarray([0.5, 2.0, 3.0])
    truth = rng.normal(size=(n, 3)) * std
    covariance = np.tile(np.diag(std**2), (n, 1, 1))
    zeros, ones = np.zeros((n, 3)), np.ones((n, 3))

    def estimates(mean, width):
        half = 1.645 * width * std
        return GaussianEstimates(
            mean, mean - half, mean + half, width**2 * covariance, np.ones(n, bool)
        )

    mean = error * std * rng.normal(size=(n, 3))
    half = np.stack([zeros - 0.674 * std, zeros + 0.674 * std], axis=1)
    return PosteriorComparison(
        file="a file",
        design="wheel, 3 rows",
        truth=truth,
        lower=-9.0 * ones,
        upper=9.0 * ones,
        prior_std=std * ones,
        conditions={"first": np.arange(n) < n // 2},
        noise=np.full(n, 0.02),
        estimates=estimates(mean, width),
        exact=estimates(zeros, 1.0),
        log_density=np.full(n, 2.0),
        exact_log_density=np.full(n, 2.3),
        rank=rng.random((n, 3)),
        interval50=half,
        exact_interval50=half,
        flagged=np.zeros(n, bool),
    )


def test_the_exact_posterior_has_ratio_one_and_nominal_coverage():
    found = comparison()
    ratio, error = found.rmse_ratio
    assert np.all(ratio == 1.0) and np.all(error == 0.0)
    assert found.coverage90()[1] == pytest.approx(0.9, abs=0.02)
    assert found.coverage50[0] == pytest.approx(0.5, abs=0.03)
    assert found.joint_coverage90[1] == pytest.approx(0.9, abs=0.02)


def test_independent_errors_of_the_mean_add_in_quadrature():
    ratio, error = comparison(error=0.5).rmse_ratio
    assert np.all(np.abs(ratio - np.hypot(1.0, 0.5)) < 4.0 * error)
    assert np.all((error > 0.003) & (error < 0.03))


def test_intervals_that_are_too_narrow_have_low_coverage():
    found = comparison(width=0.5)
    assert np.all(found.coverage90()[0] < 0.65) and found.joint_coverage90[0] < 0.5
    assert found.joint_coverage90[1] > 0.88
