"""Joining estimates of one soil, against exact Gaussian inference."""

import numpy as np
import pytest

from soilml.onboard.estimate import (
    PoolingCalibration,
    PriorSummary,
    RunConditions,
    RunPattern,
    pooled,
    pooled_within_prior,
)


def wide(mean, std):
    """A prior whose range is two standard deviations to either side."""
    return PriorSummary(mean, std, mean - 2.0 * std, mean + 2.0 * std)


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
    joint = pooled(
        np.asarray(means), np.asarray(covariances), wide(prior_mean, prior_std), np.ones(6)
    )
    np.testing.assert_allclose(joint.covariance, np.linalg.inv(total), rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(joint.mean, np.linalg.solve(total, right), rtol=0.02, atol=0.02)


def test_rows_that_tell_nothing_leave_the_prior():
    prior = wide(np.zeros(2), np.ones(2))
    joint = pooled(np.zeros((9, 2)), np.tile(np.eye(2), (9, 1, 1)), prior, np.ones(9))
    np.testing.assert_allclose(joint.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(joint.covariance)), 1.0, rtol=0.01)


def test_rows_that_contradict_each_other_raise_doubt():
    prior = wide(np.zeros(2), np.ones(2))
    sure = np.tile(np.diag([0.01, 1.0]), (2, 1, 1))
    agreeing = pooled(np.asarray([[0.5, 0.0], [0.55, 0.0]]), sure, prior, np.ones(2))
    quarrelling = pooled(np.asarray([[-0.9, 0.0], [0.9, 0.0]]), sure, prior, np.ones(2))
    assert agreeing.doubt[0] < 1.0 < 50.0 < quarrelling.doubt[0]
    outside = pooled(np.asarray([[2.9, 0.0], [2.9, 0.0]]), sure, prior, np.ones(2))
    assert outside.doubt[1] > 0.5 > agreeing.doubt[1] == 0.0


def kind(*varies):
    return RunPattern(
        varies=varies,
        rows=np.asarray([1.0, 4.0]),
        worth=np.asarray([1.0, 0.5]),
        widening=np.asarray([[1.0], [2.0]]),
        reach=np.asarray([[1.6], [1.4]]),
    )


def test_what_was_measured_of_joining_is_interpolated_and_never_extrapolated():
    worth, widening, reach = kind(True).at(2)
    assert worth == pytest.approx(0.5 * np.log(0.5))
    assert (widening, reach) == (pytest.approx(1.5), pytest.approx(1.5))
    worth, widening, _ = kind(True).at(400)
    assert np.exp(worth) * 400 == pytest.approx(0.5 * 4)  # no surer than with four rows
    assert widening == 2.0


BOX = RunConditions(
    names=("slip", "load"),
    lower=np.asarray([0.0, 20.0]),
    upper=np.asarray([0.5, 120.0]),
    std=np.asarray([0.5, 100.0]) / np.sqrt(12.0),
)


def test_rows_driven_alike_count_once_wherever_they_lie():
    rng = np.random.default_rng(0)
    for slip, load in rng.uniform([0.0, 20.0], [0.5, 120.0], (50, 2)):
        held = {"slip": slip + rng.uniform(0, 0.009, 40), "load": load + rng.uniform(0, 1.9, 40)}
        np.testing.assert_allclose(BOX.fresh(held), 1 / 40)
    points = {"slip": np.repeat([0.1, 0.3, 0.5], 20), "load": np.repeat([30.0, 30.0, 90.0], 20)}
    assert BOX.fresh(points).sum() == pytest.approx(3.0)
    free = {"slip": rng.uniform(0.0, 0.5, 12), "load": rng.uniform(20.0, 120.0, 12)}
    assert BOX.fresh(free).sum() > 10.0
    again = {name: np.tile(values, 3) for name, values in free.items()}
    assert BOX.fresh(again).sum() == pytest.approx(BOX.fresh(free).sum())


def test_how_much_a_run_varied_runs_from_steady_to_as_much_as_the_training():
    rng = np.random.default_rng(0)
    full = {"slip": rng.uniform(0.0, 0.5, 4000), "load": np.full(4000, 60.0)}
    slip, load = BOX.varied(full, np.ones(4000))
    assert slip > 0.99 and load == 0.0
    half = {"slip": 0.5 * full["slip"], "load": full["load"]}
    assert BOX.varied(half, np.ones(4000))[0] == pytest.approx(0.5, abs=0.03)
    assert (BOX.varied({"slip": np.ones(1), "load": np.ones(1)}, np.ones(1)) == 0.0).all()


def test_a_run_is_joined_as_the_kinds_of_run_between_which_it_lies():
    alone = {
        name: np.asarray(values)
        for name, values in {
            "rows": [1.0],
            "worth": [1.0],
            "widening": [[1.0]],
            "reach": [[1.6]],
        }.items()
    }
    kinds = (
        RunPattern((False, False), **alone),
        *(kind(*varies) for varies in ((False, True), (True, False), (True, True))),
    )
    together = PoolingCalibration(BOX, kinds, np.asarray([1.6]), np.asarray([5.0, 0.2]))
    prior = wide(np.zeros(1), np.ones(1))

    def told(slip, load):
        rule = together.rule({"slip": np.asarray(slip), "load": np.asarray(load)})
        m = len(slip)
        return rule, pooled_within_prior(np.full((m, 1), 0.5), np.full((m, 1, 1), 0.5), prior, rule)

    steady, one = told([0.2] * 30, [60.0] * 30)
    assert steady.share.sum() == pytest.approx(1.0)
    assert (steady.widening[0], steady.reach[0]) == (1.0, 1.6)
    assert one.covariance[0, 0] == pytest.approx(0.5)  # thirty times the same: once
    spread, _ = told([0.0, 0.5, 0.0, 0.5], [20.0, 20.0, 120.0, 120.0])
    assert spread.share == pytest.approx(0.5)
    assert spread.widening[0] == 2.0
    drifting, _ = told([0.1, 0.15, 0.2, 0.25], [60.0] * 4)
    assert 1.0 < drifting.share.sum() < 2.0
    assert 1.0 < drifting.widening[0] < 2.0
