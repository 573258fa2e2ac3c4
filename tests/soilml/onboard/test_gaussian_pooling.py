"""Pooling of estimates of one soil, against exact Gaussian inference."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.onboard.estimate import PriorSummary
from soilml.onboard.gaussian_pooling import (
    PoolingRule,
    RunConditions,
    RunPattern,
    pool,
    pool_within_prior,
)


def wide(mean, std):
    """A prior whose range is two standard deviations to either side."""
    return PriorSummary(mean, std, mean - 2.0 * std, mean + 2.0 * std)


def test_pooling_is_exact_where_everything_is_gaussian():
    rng = np.random.default_rng(0)
    prior_mean, prior_std = np.asarray([1.0, -2.0, 0.5]), np.asarray([2.0, 0.5, 1.0])
    truth = prior_mean + prior_std * rng.normal(size=3)
    P0 = np.diag(prior_std**-2)
    means, covariances, total, right = [], [], P0.copy(), P0 @ prior_mean
    for _ in range(6):
        h, noise = rng.normal(size=3), 0.3
        y = h @ truth + noise * rng.normal()
        gain = np.outer(h, h) / noise**2
        covariance = np.linalg.inv(P0 + gain)
        means.append(covariance @ (P0 @ prior_mean + h * y / noise**2))
        covariances.append(covariance)
        total += gain
        right += h * y / noise**2
    joint = pool(
        np.asarray(means), np.asarray(covariances), wide(prior_mean, prior_std), np.ones(6)
    )
    np.testing.assert_allclose(joint.covariance, np.linalg.inv(total), rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(joint.mean, np.linalg.solve(total, right), rtol=0.02, atol=0.02)
    halves = pool(
        np.reshape(means, (2, 3, 3)), np.reshape(covariances, (2, 3, 3, 3)),
        wide(prior_mean, prior_std), np.ones((2, 3)),
    )  # fmt: skip
    first = pool(
        np.asarray(means[:3]), np.asarray(covariances[:3]), wide(prior_mean, prior_std), np.ones(3)
    )
    np.testing.assert_allclose(halves.mean[0], first.mean)
    np.testing.assert_allclose(halves.inconsistency[0], first.inconsistency)


def pattern(*varies):
    return RunPattern(
        varies=varies,
        rows=np.asarray([1.0, 4.0]),
        information=np.asarray([1.0, 0.5]),
        std_scale=np.asarray([[1.0], [2.0]]),
        coverage_factor=np.asarray([[1.6], [1.4]]),
    )


def test_patterns_are_interpolated_and_never_extrapolated():
    information, std_scale, coverage_factor = pattern(True).interpolate(2)
    assert information == pytest.approx(0.5 * np.log(0.5))
    assert (std_scale, coverage_factor) == (pytest.approx(1.5), pytest.approx(1.5))
    information, std_scale, _ = pattern(True).interpolate(400)
    assert np.exp(information) * 400 == pytest.approx(0.5 * 4)  # no surer than with four rows
    assert std_scale == 2.0


BOX = RunConditions(
    names=("slip", "load"),
    lower=np.asarray([0.0, 20.0]),
    upper=np.asarray([0.5, 120.0]),
    std=np.asarray([0.5, 100.0]) / np.sqrt(12.0),
)


def test_rows_of_the_same_conditions_count_once():
    rng = np.random.default_rng(0)
    for slip, load in rng.uniform([0.0, 20.0], [0.5, 120.0], (50, 2)):
        held = {"slip": slip + rng.uniform(0, 0.009, 40), "load": load + rng.uniform(0, 1.9, 40)}
        np.testing.assert_allclose(BOX.row_weights(held), 1 / 40)
    points = {"slip": np.repeat([0.1, 0.3, 0.5], 20), "load": np.repeat([30.0, 30.0, 90.0], 20)}
    assert BOX.row_weights(points).sum() == pytest.approx(3.0)
    free = {"slip": rng.uniform(0.0, 0.5, 12), "load": rng.uniform(20.0, 120.0, 12)}
    assert BOX.row_weights(free).sum() > 10.0
    again = {name: np.tile(values, 3) for name, values in free.items()}
    assert BOX.row_weights(again).sum() == pytest.approx(BOX.row_weights(free).sum())


def test_factors_scale_the_covariance_up_to_the_prior():
    prior = wide(np.zeros(2), np.ones(2))
    row = np.asarray([[0.2, 0.03], [0.03, 0.6]])
    mean = np.asarray([prior.upper[0] + 1.0, 0.4])
    rule = PoolingRule(np.ones(1), np.asarray([1.5, 2.0]), np.full(2, 1.6))
    found = pool_within_prior(mean[None], row[None], prior, rule)
    scale = np.asarray([1.5, 1.0 / np.sqrt(0.6)])  # the second at most to the prior's deviation
    assert found.covariance == pytest.approx(row * np.outer(scale, scale), rel=1e-6)
    assert found.mean == pytest.approx([prior.upper[0], 0.4], rel=1e-6)
    narrower = replace(rule, std_scale=np.asarray([0.5, 0.5]))
    found = pool_within_prior(mean[None], row[None], prior, narrower)
    assert found.covariance == pytest.approx(0.25 * row, rel=1e-6)
