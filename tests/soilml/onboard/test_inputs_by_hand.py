"""Inputs of the graph, pooling of runs and fusion of rows, evaluated by hand."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.gaussian_pooling import (
    PoolingCalibration,
    PoolingRule,
    RunConditions,
    RunPattern,
    pool_run,
    pool_within_prior,
)
from soilml.onboard.multi_sensor import (
    SAME_PRIOR,
    fuse_estimates,
)
from soilml.onboard.set_contract import ABSENT_READING, ABSENT_STD
from soilml.onboard.set_posterior import SetPosterior, constant_noise_factor

SETS = SetPosterior(
    terms=4,
    noise={"torque": (0.3, 0.04), "sinkage": (0.001, 0.0), "torque_bias": (0.0, 0.01)},
    context_ranges={},
    context_values={},
    sets_only=True,
)
ROWS = {"slip": np.asarray([0.1, 0.2]), "torque": np.asarray([10.0, -5.0]), "load": 60.0}


def test_standard_deviations_are_those_of_the_noise_model_or_as_measured():
    rows = SETS.rows(ROWS)
    assert rows["load"].tolist() == [60.0, 60.0]
    assert rows["torque_std"] == pytest.approx([np.hypot(0.3, 0.4), np.hypot(0.3, 0.2)])
    assert rows["torque_bias"] == pytest.approx([0.1, 0.05])
    for name in ("sinkage", "drawbar_pull"):
        assert rows[name].tolist() == [ABSENT_READING] * 2
        assert rows[f"{name}_std"].tolist() == [ABSENT_STD] * 2
    more = SETS.rows(ROWS | {"sinkage": [0.01, np.nan], "torque_std": 0.7, "drawbar_pull": 3.0})
    assert more["sinkage"].tolist() == [0.01, ABSENT_READING]
    assert more["sinkage_std"].tolist() == [0.001, ABSENT_STD]
    assert more["torque_std"].tolist() == [0.7, 0.7]
    # a pull without noise, in the file or given, has no weight
    assert more["drawbar_pull_std"].tolist() == [ABSENT_STD] * 2
    # nor has a standard deviation without its reading
    alone = SETS.rows(ROWS | {"sinkage_std": 0.002})
    assert alone["sinkage"].tolist() == [ABSENT_READING] * 2
    assert alone["sinkage_std"].tolist() == [ABSENT_STD] * 2


def test_torques_with_constant_noise_are_reduced_where_their_logarithm_is_taken():
    found = SETS.with_context({}, {"torque": (0.3, 0.04)}).rows(ROWS)
    factor = np.exp(-2.0 * np.asarray([0.03, 0.06]) ** 2)
    assert found["torque"] == pytest.approx(ROWS["torque"] * factor)
    assert found["torque_std"] == pytest.approx(SETS.rows(ROWS)["torque_std"] * factor)
    later = SETS.with_context({}, {"torque": (0.3, 0.04)}).with_context({}, {"slip": (0.0, 0.0)})
    assert later.rows(ROWS)["torque"].tolist() == found["torque"].tolist()
    unchanged = (
        (SETS, {}),  # the noise of the file
        (SETS.with_context({}, {"torque": (0.0, 0.04)}), {}),  # a share of the reading
        (SETS.with_context({}, {"torque": (0.3, 0.04)}), {"torque_std": 0.3}),
        (replace(SETS, log_torque=False).with_context({}, {"torque": (0.3, 0.04)}), {}),
    )
    for sets, given in unchanged:
        assert sets.rows(ROWS | given)["torque"].tolist() == ROWS["torque"].tolist()


@pytest.mark.parametrize("constant, share", [(0.05, 0.0), (0.1, 0.0), (0.06, 0.08), (0.15, 0.02)])
def test_the_weighted_logarithm_of_torques_with_constant_noise_has_no_bias(constant, share):
    """Against a quadrature over the noise of a torque of 1 N m, weighted as the graph does."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    near = np.abs(nodes) < 6.0
    true_std = np.hypot(constant, share)
    reading = 1.0 + true_std * nodes[near]

    def bias(factor):
        relative = np.hypot(constant, share * reading) / reading
        log_torque = np.log(reading * factor) + 0.5 * relative**2
        total = weights[near] / relative**2
        return (total @ log_torque) / total.sum()

    before, after = bias(1.0), bias(constant_noise_factor(reading, constant))
    assert before > 1.8 * constant**2
    assert abs(after) < 0.1 * before


@pytest.mark.parametrize("name, value, said", [
    ("torque_std", 0.0, "it must be above zero"),
    ("sinkage_std", -1.0, "it must be above zero"),
    ("torque_bias", -1e-9, "it must be zero or more"),
])  # fmt: skip
def test_impossible_standard_deviations_are_refused(name, value, said):
    with pytest.raises(InputError, match=said):
        SETS.rows(ROWS | {name: value, "sinkage": 0.01})
    assert SETS.rows(ROWS | {"torque_bias": 0.0})["torque_bias"].tolist() == [0.0, 0.0]


def test_a_noise_is_two_numbers_of_zero_or_more():
    for wrong in ((-0.1, 0.0), (0.0, np.inf), (0.1,), 0.1):
        with pytest.raises(InputError, match=r"noise of torque is .*; needed are two numbers"):
            SETS.with_context({}, {"torque": wrong})
    with pytest.raises(InputError, match="noise of height"):
        SETS.with_context({}, {"height": (0.0, 0.1)})
    assert SETS.with_context({}, {"torque": (0.0, 0.0)}).noise["torque"] == (0.0, 0.0)


PRIOR = PriorSummary(
    np.asarray([1.0, 10.0]),
    np.asarray([0.5, 4.0]),
    np.asarray([0.0, 2.0]),
    np.asarray([2.0, 18.0]),
)


def estimates(mean, std, in_range, prior=PRIOR):
    mean, std = np.asarray(mean, dtype=float), np.asarray(std, dtype=float)
    covariance = std[..., None] ** 2 * np.eye(2)
    return Estimate.gaussian(
        *(("a", "b"), ("1", "1"), prior, mean, covariance, std, np.asarray(in_range), np.ones(2))
    )


def test_fused_rows_keep_shape_ends_and_reasons():
    """One file alone in a row keeps its interval; none gives the prior; two are fused."""
    first = estimates([[[1.0, 9.0], [1.5, 9.0]]], [[[0.1, 1.0]] * 2], [[True, False]])
    second = estimates([[[1.2, 9.0], [1.5, 9.0]]], [[[0.1, 1.0]] * 2], [[False, False]])
    found = fuse_estimates([first, second], "prior-once")
    assert found.estimate.mean.shape == (1, 2, 2)
    assert found.estimate.low[0, 0] == pytest.approx([0.9, 8.0])
    assert found.estimate.high[0, 0] == pytest.approx([1.1, 10.0])
    assert found.estimate.mean[0, 1] == pytest.approx(PRIOR.mean)
    assert found.estimate.std[0, 1] == pytest.approx(PRIOR.std)
    assert found.estimate.low[0, 1] == pytest.approx(PRIOR.mean - 1.6448536 * PRIOR.std)
    assert found.used.tolist() == [[[True, False]], [[False, False]]]
    assert found.estimate.reason.tolist() == [[Reason.ESTIMATED, Reason.OUT_OF_RANGE]]
    apart = estimates([[[1.9, 9.0], [1.5, 9.0]]], [[[0.1, 1.0]] * 2], [[True, False]])
    found = fuse_estimates([first, apart], "prior-once")
    assert found.estimate.reason[0, 0] == Reason.CONTRADICTORY and not found.used.any()


def test_priors_must_agree_to_a_hundredth_of_their_spread():
    one = estimates([1.0, 9.0], [0.1, 1.0], True)
    for share, refused in ((0.9, False), (1.1, True)):
        prior = replace(PRIOR, mean=PRIOR.mean - share * SAME_PRIOR * PRIOR.std)
        other = estimates([1.0, 9.0], [0.1, 1.0], True, prior)
        if refused:
            with pytest.raises(InputError, match="different priors of a, b: from 0, 2 to 2, 18"):
                fuse_estimates([one, other])
        else:
            assert fuse_estimates([one, other]).estimate.in_range


def test_an_estimate_of_no_rows_is_empty_and_its_errors_are_not_shown():
    none = Estimate.from_prior(("a", "b"), ("1", "1"), PRIOR, (0,))
    assert none.mean.shape == (0, 2) and none.covariance.shape == (0, 2, 2)
    for shape in ((-1,), (1.5,)):
        with pytest.raises(InputError, match="whole numbers of zero or more"):
            Estimate.from_prior(("a", "b"), ("1", "1"), PRIOR, shape)
    assert "errors" not in repr(none)


CONDITIONS = RunConditions(("slip",), np.asarray([0.0]), np.asarray([0.5]), np.asarray([0.1]))


def calibration(limit=9.0):
    pattern = RunPattern(
        varies=(False,),
        rows=np.asarray([1.0, 4.0]),
        information=np.asarray([1.0, 1.0]),
        std_scale=np.full((2, 2), 1.2),
        coverage_factor=np.full((2, 2), 1.5),
    )
    free = replace(pattern, varies=(True,))
    limits = np.full(2, limit)
    return PoolingCalibration(CONDITIONS, (pattern, free), np.asarray([1.7, 1.8]), limits)


def test_a_run_is_pooled_unless_more_than_half_is_out_of_range():
    slip = np.linspace(0.05, 0.45, 20)
    mean, std = np.tile([1.2, 9.0], (20, 1)), np.tile([0.2, 2.0], (20, 1))
    for out, pooled in ((2, True), (10, True), (11, False)):
        single = estimates(mean, std, np.arange(20) >= out)
        found = pool_run(single, {"slip": slip}, calibration())
        assert (found.rows_used, found.rows_set_aside) == (20 - out, out)
        assert found.in_range == pooled
        if not pooled:
            assert found.mean == pytest.approx(PRIOR.mean) and found.reason == Reason.OUT_OF_RANGE
    single = estimates(mean, std, np.arange(20) >= 2)
    rows = {"slip": slip[2:]}
    rule = calibration().rule(rows)
    assert rule.std_scale == pytest.approx(np.full(2, 1.2))
    expected = pool_within_prior(mean[2:], single.covariance[2:], PRIOR, rule)
    found = pool_run(single, {"slip": slip}, calibration())
    assert found.mean == pytest.approx(expected.mean)
    half = 1.5 * np.sqrt(np.diag(expected.covariance))
    assert found.low == pytest.approx(expected.mean - half)


def test_a_run_of_one_row_has_its_own_coverage_and_inconsistent_rows_give_the_prior():
    single = estimates([[1.0, 9.0]], [[0.1, 1.0]], [True])
    found = pool_run(single, {"slip": np.asarray([0.2])}, calibration())
    assert found.low == pytest.approx([1.0 - 1.7 * 0.1, 9.0 - 1.8])
    apart = estimates([[0.2, 9.0], [1.8, 9.0]], [[0.1, 1.0]] * 2, [True, True])
    slip = {"slip": np.asarray([0.1, 0.4])}
    found = pool_run(apart, slip, calibration())
    assert found.reason == Reason.INCONSISTENT and not found.in_range and found.rows_used == 2
    assert pool_run(apart, slip, calibration(limit=1e6)).in_range


def test_a_scaled_spread_is_at_most_that_of_the_prior():
    covariance = np.asarray([np.diag([0.4**2, 1.0])])
    rule = PoolingRule(np.ones(1), np.full(2, 1.5), np.ones(2))
    found = pool_within_prior(np.asarray([[1.0, 9.0]]), covariance, PRIOR, rule)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([0.5, 1.5], rel=2e-3)


def test_spreads_of_several_runs_are_scaled_each_by_its_own():
    spread = np.asarray([[0.4, 1.0], [0.1, 3.0], [0.2, 2.0]])
    covariance = (spread[..., None] ** 2 * np.eye(2))[:, None]
    rule = PoolingRule(np.ones((3, 1)), np.full((3, 2), 1.5), np.ones((3, 2)))
    found = pool_within_prior(np.tile([1.0, 9.0], (3, 1, 1)), covariance, PRIOR, rule)
    std = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert std == pytest.approx(np.minimum(1.5 * spread, PRIOR.std), rel=5e-3)


def test_a_fused_mean_stays_within_the_prior():
    near = estimates([[1.97, 17.9], [0.03, 2.1]], [[0.1, 1.0]] * 2, [True, True])
    found = fuse_estimates([near] * 4, "prior-once").estimate
    assert found.mean == pytest.approx(np.asarray([PRIOR.upper, PRIOR.lower]))
    assert found.high[0] == pytest.approx(PRIOR.upper)
    assert found.low[1] == pytest.approx(PRIOR.lower)


def test_an_estimate_draws_a_panel_for_each_quantity():
    axes = estimates([[1.0, 9.0], [1.2, 9.5]], [[0.1, 1.0]] * 2, [True, True]).plot()
    assert [ax.get_title(loc="left") or ax.get_xlabel() or ax.get_ylabel() for ax in axes]
    words = [" ".join(t.get_text() for t in ax.findobj() if hasattr(t, "get_text")) for ax in axes]
    assert len(axes) == 2 and "a" in words[0].split() and "b" in words[1].split()
