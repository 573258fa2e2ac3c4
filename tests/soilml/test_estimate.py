"""Joining estimates of one soil, against exact Gaussian inference."""

import numpy as np
import pytest

from soilml.estimate import Together, joined


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
    mean, covariance = joined(
        np.asarray(means), np.asarray(covariances), prior_mean, prior_std, worth=1.0
    )
    np.testing.assert_allclose(covariance, np.linalg.inv(total), rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(mean, np.linalg.solve(total, right), rtol=0.02, atol=0.02)


def test_rows_that_tell_nothing_leave_the_prior():
    prior_mean, prior_std = np.zeros(2), np.ones(2)
    mean, covariance = joined(
        np.zeros((9, 2)), np.tile(np.eye(2), (9, 1, 1)), prior_mean, prior_std, worth=1.0
    )
    np.testing.assert_allclose(mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), 1.0, rtol=0.01)


def test_what_was_measured_of_joining_is_interpolated_and_never_extrapolated():
    together = Together(
        rows=np.asarray([1.0, 4.0]),
        worth=np.asarray([1.0, 0.5]),
        widening=np.asarray([[1.0], [2.0]]),
        reach=np.asarray([[1.6], [1.4]]),
    )
    worth, widening, reach = together.at(2)
    assert worth == pytest.approx(0.5**0.5)
    assert (widening[0], reach[0]) == (pytest.approx(1.5), pytest.approx(1.5))
    worth, widening, _ = together.at(400)
    assert worth * 400 == pytest.approx(0.5 * 4)  # no surer than with four rows
    assert widening[0] == 2.0
