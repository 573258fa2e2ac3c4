"""Figures of a file beside the exact posterior, on answers whose figures are known."""

from dataclasses import replace

import numpy as np
import pytest

from training.benchmark.sets.agreement import Agreement, FileAnswers, combined, uniform


def known(n=4000, stray=0.0, narrow=1.0, seed=0):
    """A normal posterior of three parameters, and a file whose mean strays from its mean."""
    rng = np.random.default_rng(seed)
    std = np.asarray([0.5, 2.0, 3.0])
    truth = rng.normal(size=(n, 3)) * std
    covariance = np.tile(np.diag(std**2), (n, 1, 1))
    zeros, ones = np.zeros((n, 3)), np.ones((n, 3))

    def answers(mean, wide):
        half = 1.645 * wide * std
        return FileAnswers(mean, mean - half, mean + half, wide**2 * covariance, np.ones(n, bool))

    own = stray * std * rng.normal(size=(n, 3))
    half = np.stack([zeros - 0.674 * std, zeros + 0.674 * std], axis=1)
    return Agreement(
        file="a file",
        design="wheel, 3 rows",
        truth=truth,
        lower=-9.0 * ones,
        upper=9.0 * ones,
        spread=std * ones,
        kinds={"first": np.arange(n) < n // 2},
        noise=np.full(n, 0.02),
        own=answers(own, narrow),
        exact=answers(zeros, 1.0),
        density=np.full(n, 2.0),
        dense=np.full(n, 2.3),
        below=rng.random((n, 3)),
        inner=half,
        least_inner=half,
        flagged=np.zeros(n, bool),
    )


def test_the_exact_posterior_has_the_ratio_one_and_holds_what_it_says():
    found = known()
    ratio, error = found.ratio
    assert np.all(ratio == 1.0) and np.all(error == 0.0)
    assert found.cover90()[1] == pytest.approx(0.9, abs=0.02)
    assert found.cover50[0] == pytest.approx(0.5, abs=0.03)
    assert found.joint90[1] == pytest.approx(0.9, abs=0.02)


def test_a_mean_that_strays_has_the_ratio_that_pythagoras_gives():
    ratio, error = known(stray=0.5).ratio
    assert np.all(np.abs(ratio - np.hypot(1.0, 0.5)) < 4.0 * error)
    assert np.all((error > 0.003) & (error < 0.03))


def test_intervals_that_are_too_narrow_hold_too_little():
    found = known(narrow=0.5)
    assert np.all(found.cover90()[0] < 0.65) and found.joint90[0] < 0.5
    assert found.joint90[1] > 0.88


def test_the_gap_is_the_log_density_that_is_lacking():
    assert known().gap == pytest.approx((0.3, 0.0), abs=1e-12)


def test_sets_that_are_not_answered_take_no_part():
    found = known()
    far = replace(found.own, mean=found.own.mean + 1e6 * (np.arange(4000) < 9)[:, None])
    answered = replace(far, given=np.arange(4000) >= 9)
    assert np.all(replace(found, own=far).ratio[0] > 1e3)
    assert np.all(replace(found, own=answered).ratio[0] == 1.0)


def test_parts_joined_are_the_whole():
    found = known(stray=0.3)
    first = found.kinds["first"]
    again = combined([found.where(first), found.where(~first)])
    assert np.array_equal(again.own.mean, found.own.mean)
    assert np.array_equal(again.kinds["first"], first)
    assert again.ratio[0] == pytest.approx(found.ratio[0])


def test_shares_that_are_uniform_are_found_so_and_others_are_not():
    rng = np.random.default_rng(3)
    even = rng.random((2000, 1))
    assert uniform(even, (0.1, 0.5, 0.9))[0] > 0.01
    assert uniform(even**1.3, (0.1, 0.5, 0.9))[0] < 1e-6
    assert uniform(0.5 + 0.8 * (even - 0.5), (0.05, 0.95))[0] < 1e-6
