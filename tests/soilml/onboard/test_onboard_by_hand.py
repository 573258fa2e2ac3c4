"""Small rules of the onboard estimates against their equations, evaluated by hand."""

import numpy as np
import pytest

from soilml.numerics.quantiles import chi_squared_quantile
from soilml.onboard import Estimator
from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.gaussian_pooling import LEAST_STD_RATIO, RowInformation, RunConditions
from soilml.onboard.narrower_prior import (
    NO_INFORMATION,
    _quantiles,
    _without_prior,
    truncated_normal,
    within_box,
)
from soilml.onboard.tracking.misfit import (
    chi_squared_limit,
    excess_noise,
    over_median,
    usual_excess,
)

PRIOR = PriorSummary(
    np.asarray([1.0, 10.0]),
    np.asarray([0.5, 4.0]),
    np.asarray([0.0, 2.0]),
    np.asarray([2.0, 18.0]),
)


def test_an_estimate_that_is_the_prior_has_its_moments():
    found = Estimate.from_prior(("a", "b"), ("1", "1"), PRIOR, (2,))
    assert found.mean.tolist() == [[1.0, 10.0]] * 2
    assert found.covariance.tolist() == [[[0.25, 0.0], [0.0, 16.0]]] * 2
    # the 90 % interval of a Gaussian, cut at the ends of the range
    assert found.low[0] == pytest.approx([1.0 - 1.6448536 * 0.5, 10.0 - 1.6448536 * 4.0])
    assert found.high[0] == pytest.approx([1.0 + 1.6448536 * 0.5, 10.0 + 1.6448536 * 4.0])
    assert (found.reason == Reason.OUT_OF_RANGE).all() and found.abstains.all()
    assert found.rows_used.tolist() == [0, 0] and found.rows_set_aside.tolist() == [1, 1]


def test_a_mean_within_one_and_a_half_standard_deviations_of_an_end_is_at_the_edge():
    mean = np.asarray([[1.49, 10.0], [1.51, 10.0], [1.0, 3.51], [1.0, 3.49], [1.0, 16.6]])
    std = np.broadcast_to([1.0 / 3.0, 1.0], (5, 2))
    found = Estimate.gaussian(
        *(("a", "b"), ("1", "1"), PRIOR, mean, std[..., None] * np.eye(2), std),
        *(np.ones(5, dtype=bool), np.ones(2)),
    )
    at_edge = [[False, False], [True, False], [False, False], [False, True], [False, True]]
    assert found.at_edge.tolist() == at_edge


def test_an_estimator_shows_what_it_reads_and_nothing_of_its_graph():
    shown = repr(Estimator.load("exported/wheel.onnx"))
    assert shown.startswith("Estimator(path=") and "inputs=('slip', 'torque', 'load')" in shown
    for hidden in ("metadata", "pooling", "sets", "session"):
        assert f"{hidden}=" not in shown


def test_weights_of_several_runs_keep_their_dimensions():
    box = RunConditions(
        ("slip", "load"), np.asarray([0.0, 20.0]), np.asarray([0.5, 120.0]), np.ones(2)
    )
    rng = np.random.default_rng(0)
    runs = {
        "slip": rng.uniform(0.0, 0.5, (2, 3, 7)).round(1),
        "load": rng.uniform(20.0, 120.0, (2, 3, 7)).round(-1),
    }
    weights = box.row_weights(runs)
    assert weights.shape == (2, 3, 7)
    for i, j in np.ndindex(2, 3):
        alike = [
            sum(
                runs["slip"][i, j, k] == runs["slip"][i, j, m]
                and runs["load"][i, j, k] == runs["load"][i, j, m]
                for m in range(7)
            )
            for k in range(7)
        ]
        assert weights[i, j] == pytest.approx(1.0 / np.asarray(alike))


def test_rows_out_of_range_count_at_its_ends():
    box = RunConditions(("slip",), np.asarray([0.0]), np.asarray([0.5]), np.ones(1))
    slip = {"slip": np.asarray([-0.3, 0.0, 0.25, 0.5, 0.9])}
    assert box.row_weights(slip).tolist() == [0.5, 0.5, 1.0, 0.5, 0.5]
    # rows in adjacent bins, of a hundredth of slip each, are alike; those one further are not
    apart = {"slip": np.asarray([0.101, 0.119])}
    assert box.row_weights(apart).tolist() == [0.5, 0.5]
    assert box.row_weights({"slip": np.asarray([0.101, 0.121])}).tolist() == [1.0, 1.0]


def test_a_row_is_never_surer_than_a_thousandth_of_the_prior():
    narrow = np.diag([(1e-4 * 0.5) ** 2, (0.5 * 4.0) ** 2])
    found = RowInformation.of(np.asarray([1.25, 12.0]), narrow, PRIOR)
    assert found.information == pytest.approx([1.0 / LEAST_STD_RATIO**2 - 1.0, 3.0])
    assert np.abs(found.projected) == pytest.approx([0.5 / LEAST_STD_RATIO**2, 0.5 / 0.25])
    vague = RowInformation.of(PRIOR.mean, np.diag(PRIOR.std**2), PRIOR)
    assert vague.information == pytest.approx(1.0 / (1.0 - LEAST_STD_RATIO) - 1.0)


def test_excess_noise_is_the_misfit_over_the_readings_that_are_left():
    """Eight readings with the stated noise are assumed beforehand."""
    assert excess_noise(12.0, 15.0, 3) == pytest.approx((12.0 + 8.0) / (12.0 + 8.0))
    assert excess_noise(12.0, 3.5, 3) == pytest.approx(20.0 / 8.5)
    assert excess_noise(12.0, 2.0, 3) == pytest.approx(20.0 / 8.0)


def test_usual_excess_is_the_median_with_three_sound_rows_assumed():
    assert usual_excess([]) == usual_excess([0.1, 0.2, 0.3]) == 1.0
    assert usual_excess([4.0, 5.0, 6.0, 7.0]) == 4.0
    assert usual_excess([4.0, 5.0, 6.0, 7.0, 8.0]) == pytest.approx(4.5)
    assert usual_excess([99.0] * 4) == 10.0


def test_limits_are_those_of_chi_squared():
    assert chi_squared_limit(2.0) == pytest.approx(chi_squared_quantile(2.0, 3.72))
    assert 17.0 < chi_squared_limit(2.0) < 19.5  # -2 ln 1e-4 is 18.4
    assert over_median(2.77, 2.0) == pytest.approx(2.0, rel=0.02)  # the median is 2 ln 2


def test_weighted_quantiles_lie_between_the_middles_of_the_weights():
    x, weights = np.asarray([3.0, 1.0, 2.0]), np.asarray([0.06, 0.04, 0.9])
    # middles of the sorted weights: 0.02, 0.49, 0.97
    low, high = _quantiles(x, weights)
    assert low == pytest.approx(1.0 + (0.05 - 0.02) / (0.49 - 0.02))
    assert high == pytest.approx(2.0 + (0.95 - 0.49) / (0.97 - 0.49))


def test_a_box_that_fixes_a_quantity_leaves_the_others():
    mean, covariance = np.asarray([0.5, 1e4]), np.asarray([[0.01, 20.0], [20.0, 4e6]])
    prior = np.zeros(2), np.asarray([1.0, 2e4])
    interval = np.asarray([[0.35, 7e3], [0.65, 1.3e4]])
    box = np.asarray([0.4, 0.0]), np.asarray([0.4 + 1e-10, 2e4])
    found = within_box(mean, covariance, interval, prior, box)
    assert found.mean[0] == pytest.approx(0.4) and found.std[0] <= 1e-10
    assert found.low[0] == pytest.approx(0.4) and found.high[0] == pytest.approx(0.4)
    # the second follows by its correlation: slope 2000, one standard deviation lower
    assert found.mean[1] == pytest.approx(1e4 - 200.0, abs=60.0)
    assert found.std[1] == pytest.approx(np.sqrt(4e6 - 20.0**2 / 0.01), rel=0.03)


def test_a_box_beyond_the_estimate_moves_it_by_what_it_was_off_at_most():
    """Where the cut has the larger spread, the difference is carried over once, not more."""
    mean, covariance = np.asarray([0.02]), np.asarray([[0.015**2]])
    prior, interval = (np.zeros(1), np.ones(1)), np.asarray([[0.002], [0.05]])
    normal = _without_prior(mean, covariance, *prior)
    box = np.asarray([0.0]), np.asarray([0.9])
    before, after = truncated_normal(*normal, *prior), truncated_normal(*normal, *box)
    found = within_box(mean, covariance, interval, prior, box)
    left = np.clip(after.std / before.std, 0.0, 1.0)
    assert found.mean == pytest.approx(np.clip(after.mean + left * (mean - before.mean), *box))
    assert found.low == pytest.approx(after.low + left * (0.002 - before.low))


def test_a_spread_is_at_most_half_the_box():
    """An estimate that is wider than a normal one between the same ends: 0.45 of the prior."""
    mean, covariance = np.asarray([0.5]), np.asarray([[0.45**2]])
    prior, interval = (np.zeros(1), np.ones(1)), np.asarray([[0.0], [1.0]])
    found = within_box(mean, covariance, interval, prior, (np.asarray([0.2]), np.asarray([0.6])))
    assert found.std[0] == pytest.approx(0.45 * 0.4, rel=1e-3)
    covariance = np.asarray([[0.8**2]])
    found = within_box(mean, covariance, interval, prior, (np.asarray([0.2]), np.asarray([0.6])))
    assert found.std[0] == pytest.approx(0.2)


def test_readings_that_tell_nothing_are_as_wide_as_twenty_priors():
    _, covariance = _without_prior(
        np.asarray([0.5]), np.asarray([[1.0 / 12.0]]), np.zeros(1), np.ones(1)
    )
    assert covariance == pytest.approx(np.asarray([[NO_INFORMATION**2]]))
