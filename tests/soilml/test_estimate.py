"""Joining estimates of one soil, against exact Gaussian inference."""

import numpy as np
import pytest

from soilml.estimate import Known, Together, joined


def wide(mean, std):
    """A prior whose range is two standard deviations to either side."""
    return Known(mean, std, mean - 2.0 * std, mean + 2.0 * std)


def test_joining_is_exact_where_everything_is_gaussian():
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
    joint = joined(np.asarray(means), np.asarray(covariances), wide(prior_mean, prior_std), 1.0)
    np.testing.assert_allclose(joint.covariance, np.linalg.inv(total), rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(joint.mean, np.linalg.solve(total, right), rtol=0.02, atol=0.02)


def test_rows_that_tell_nothing_leave_the_prior():
    prior = wide(np.zeros(2), np.ones(2))
    joint = joined(np.zeros((9, 2)), np.tile(np.eye(2), (9, 1, 1)), prior, 1.0)
    np.testing.assert_allclose(joint.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(joint.covariance)), 1.0, rtol=0.01)


def test_rows_that_contradict_each_other_raise_doubt():
    prior = wide(np.zeros(2), np.ones(2))
    sure = np.tile(np.diag([0.01, 1.0]), (2, 1, 1))
    agreeing = joined(np.asarray([[0.5, 0.0], [0.55, 0.0]]), sure, prior, 1.0)
    quarrelling = joined(np.asarray([[-0.9, 0.0], [0.9, 0.0]]), sure, prior, 1.0)
    assert agreeing.doubt[0] < 1.0 < 50.0 < quarrelling.doubt[0]
    outside = joined(np.asarray([[2.9, 0.0], [2.9, 0.0]]), sure, prior, 1.0)
    assert outside.doubt[1] > 0.5 > agreeing.doubt[1] == 0.0


def test_what_was_measured_of_joining_is_interpolated_and_never_extrapolated():
    together = Together(
        rows=np.asarray([1.0, 4.0]),
        worth=np.asarray([1.0, 0.5]),
        widening=np.asarray([[1.0], [2.0]]),
        reach=np.asarray([[1.6], [1.4]]),
        doubt=np.asarray([[1.0, 0.0], [3.0, 0.2]]),
    )
    worth, widening, reach, doubt = together.at(2)
    assert worth == pytest.approx(0.5**0.5)
    assert (widening[0], reach[0]) == (pytest.approx(1.5), pytest.approx(1.5))
    np.testing.assert_allclose(doubt, [2.0, 0.1])
    worth, widening, _, _ = together.at(400)
    assert worth * 400 == pytest.approx(0.5 * 4)  # no surer than with four rows
    assert widening[0] == 2.0
