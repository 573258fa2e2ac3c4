"""Rules of fusion against their equations, evaluated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from test_joint_errors import Sensors

from soilml.onboard.fusion_rules import best_linear
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.joint_errors import (
    DISAGREEMENT,
    LEAST_AVERAGES,
    JointErrors,
    _disagreement,
    _measure,
    _reach,
    joint_errors,
)
from soilml.onboard.narrower_prior import _without_prior, truncated_normal, within_box

ONE = np.ones(2)
RULE = JointErrors(
    correlation=np.eye(2),
    alone=None,
    centre=0.3,
    gain=0.8,
    std_scale=1.5,
    middles=np.asarray([0.0, 1.0]),
    low=np.asarray([-1.0, -2.0]),
    high=np.asarray([1.5, 3.5]),
    repeats=16.0,
    repeat_std=2.0,
    repeat_interval=3.0,
)


def test_estimates_that_agree_have_the_std_of_their_mean():
    mean, std = np.asarray([[0.5], [0.5]]), np.full((2, 1), 0.1)
    centre, spread, disagreement = RULE.fuse(mean, std, ONE)
    assert disagreement == pytest.approx([0.0])
    assert centre == pytest.approx([0.3 + 0.8 * (0.5 - 0.3)])
    assert spread == pytest.approx([1.5 * 0.1 / np.sqrt(2.0)])


def test_the_std_grows_with_the_disagreement_over_its_limit():
    apart = 4.0 * DISAGREEMENT * 0.1 * np.sqrt(2.0)
    mean, std = np.asarray([[0.5], [0.5 + apart]]), np.full((2, 1), 0.1)
    _, spread, disagreement = RULE.fuse(mean, std, ONE)
    assert disagreement == pytest.approx([4.0 * DISAGREEMENT])
    assert spread == pytest.approx([4.0 * 1.5 * 0.1 / np.sqrt(2.0)])


@pytest.mark.parametrize(
    ("count", "factor", "reach"), [(1.0, 1.0, 1.0), (4.0, 1.5, 2.0), (64.0, 2.0, 3.0)]
)
def test_factors_of_repetition_are_interpolated_in_the_logarithm(count, factor, reach):
    mean, std = np.asarray([[0.5], [0.5]]), np.full((2, 1), 0.1)
    _, spread, _ = RULE.fuse(mean, std, ONE, count)
    assert spread == pytest.approx([factor * 1.5 * 0.1 / np.sqrt(2.0)])
    low, high = RULE.interval(np.asarray([0.5]), np.asarray([0.1]), count)
    assert low == pytest.approx([0.5 - 1.5 * reach * 0.1])
    assert high == pytest.approx([0.5 + 2.5 * reach * 0.1])


def test_repetition_needs_enough_averages_of_the_same_number_of_readings():
    first, second = Sensors().files()
    (rule,) = joint_errors((first, second))
    assert rule.repeats == 8.0

    def changed(file, key, **values):
        return replace(file, key=key, **values)

    other = changed(second, "other", repeats=np.asarray([1, 5]))
    (rule,) = joint_errors((first, other))
    assert rule.repeats == 1.0
    few = changed(second, "few", average_rows=second.average_rows + 700 - LEAST_AVERAGES + 1)
    (rule,) = joint_errors((first, few))
    assert rule.repeats == 1.0


def test_the_share_that_repeated_readings_have_in_common_is_that_of_their_errors():
    for soil in (0.2, 0.7):
        file = Sensors(common=0.1, soil=soil).files()[0]
        assert file.common_share() == pytest.approx([soil], abs=1e-9)
    alone = replace(file, repeats=np.asarray([1]), repeat_std=np.ones((1, 1)))
    assert alone.common_share() == pytest.approx([1.0])


def test_numbers_are_written_with_four_digits():
    entry = Sensors().files()[0].entry()
    assert isinstance(HeldOutErrors.of(entry), HeldOutErrors)
    for row in entry["mean"][:50]:
        assert float(f"{row[0]:.4g}") == row[0]


def test_a_box_scales_the_std_as_the_estimate_differs_from_a_normal_one():
    mean, covariance = np.asarray([0.12]), np.asarray([[0.07**2]])
    prior, box = (np.zeros(1), np.ones(1)), (np.zeros(1), np.asarray([0.3]))
    interval = np.asarray([[0.02], [0.25]])
    found = within_box(mean, covariance, interval, prior, box)
    normal = _without_prior(mean, covariance, *prior)
    before, after = truncated_normal(*normal, *prior), truncated_normal(*normal, *box)
    assert before.std != pytest.approx([0.07], rel=0.02)  # the estimate is not a cut normal one
    assert found.std == pytest.approx(after.std * 0.07 / before.std)
    left = after.std / before.std
    assert found.mean == pytest.approx(after.mean + left * (mean - before.mean))
    assert found.high == pytest.approx(after.high + left * (0.25 - before.high))
    assert found.mass == pytest.approx(after.mass / before.mass)


def test_what_readings_tell_without_the_prior_is_the_difference_of_precisions():
    mean, std, width = np.asarray([0.4, 3.0]), np.asarray([0.1, 0.5]), np.asarray([1.0, 4.0])
    lower = np.asarray([0.1, -1.0])
    found, covariance = _without_prior(mean, np.diag(std**2), lower, lower + width)
    precision = 1.0 / std**2 - 12.0 / width**2
    assert np.diag(covariance) == pytest.approx(1.0 / precision)
    assert found == pytest.approx(
        (mean / std**2 - (lower + 0.5 * width) * 12.0 / width**2) / precision
    )


def test_averages_that_are_worse_than_readings_share_no_more_than_everything():
    file = replace(Sensors().files()[0], repeat_std=np.asarray([[1.0], [1.1]]))
    assert file.common_share() == pytest.approx([1.0])
    file = replace(file, repeat_std=np.asarray([[1.0], [0.1]]))
    assert file.common_share() == pytest.approx([0.0])


def test_gain_and_ends_of_the_interval_are_those_of_the_held_out_rows():
    files = Sensors().files()
    (rule,) = joint_errors(tuple(files))
    assert rule.alone is None
    truth = files[0].truth[:, 0]
    mean = np.stack([file.mean[:, 0] for file in files])
    std = np.stack([file.std[:, 0] for file in files])
    away = best_linear(mean, std, rule.correlation).mean - truth.mean()
    assert rule.gain == pytest.approx(away @ (truth - truth.mean()) / (away @ away))
    assert np.all((rule.low < -1.2) & (rule.low > -2.4))  # normal errors: near 1.645
    assert np.all((rule.high > 1.2) & (rule.high < 2.4))


def test_ends_of_the_interval_are_in_standard_deviations_of_the_row():
    """Errors of two sensors grow tenfold over the range of the true values."""
    rng = np.random.default_rng(4)
    truth = rng.uniform(0.0, 10.0, 6000)
    std = np.stack([0.05 * (1.0 + truth), 0.08 * (1.0 + truth)])
    mean = truth + std * rng.normal(size=(2, 6000))
    rule = _measure(truth, mean, std)
    assert rule.low == pytest.approx([-1.645] * len(rule.low), abs=0.6)
    assert rule.high == pytest.approx([1.645] * len(rule.high), abs=0.6)


def test_an_interval_holds_its_mean_where_all_errors_of_a_bin_lie_on_one_side():
    """Estimates too low in the lower half of the range and too high in the upper one."""
    rng = np.random.default_rng(5)
    truth = np.sort(rng.uniform(0.0, 10.0, 4000))
    shift = np.where(truth < 5.0, -0.4, 0.4)
    mean = truth + shift + 0.02 * rng.normal(size=(2, 4000))
    rule = _measure(truth, mean, np.full((2, 4000), 0.4))
    assert (rule.low <= 0.0).all() and (rule.high >= 0.0).all()
    assert (rule.low == 0.0).any() and (rule.high == 0.0).any()
    fused, spread, _ = rule.fuse(mean, np.full((2, 4000), 0.4), np.ones(2))
    low, high = rule.interval(fused, spread)
    assert np.mean((low <= truth) & (truth <= high)) == pytest.approx(0.9, abs=0.005)


def test_the_interval_of_repeated_readings_is_widened_by_their_number():
    """By half at the 16 readings that were measured, by a quarter at 4, by no more beyond."""
    rule = replace(RULE, repeats=16.0, repeat_interval=1.5)
    mean, std = np.asarray([0.5]), np.asarray([0.4])
    ends = [rule.interval(mean, std, count)[1][0] - 0.5 for count in (1.0, 4.0, 16.0, 99.0)]
    assert np.asarray(ends) / ends[0] == pytest.approx([1.0, 1.25, 1.5, 1.5])


def test_an_interval_is_widened_until_it_holds_nine_tenths():
    """Errors of -1, -0.9 ... 1 below and above 0.5, in an interval from -1 to 1.5 around it."""
    truth = 0.5 + np.linspace(-1.0, 1.0, 21)
    mean, std = np.full(21, 0.5), np.full(21, 0.4)
    # ends where the mean is half way between the middles: -1.5 and 2.5 standard deviations
    reached = np.sort([*(np.linspace(0.1, 1.0, 10) / 0.6), *(np.linspace(0.0, 1.0, 11) / 1.0)])
    expected = np.quantile(reached, 0.9, method="weibull")
    plain = replace(RULE, repeats=1.0)
    assert _reach(plain, truth, mean, std) == pytest.approx(expected)


def test_disagreement_is_in_standard_deviations_of_the_difference():
    mean, std = np.asarray([[0.5], [0.9], [0.4]]), np.asarray([[0.1], [0.2], [0.1]])
    correlation = np.asarray([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 1.0]])
    pairs = [
        0.4 / np.sqrt(0.01 + 0.04 - 2.0 * 0.8 * 0.02),
        0.1 / np.sqrt(0.02),
        0.5 / np.sqrt(0.05),
    ]
    assert _disagreement(mean, std, correlation) == pytest.approx([max(pairs)])
    assert _disagreement(mean[:1], std[:1], correlation) == pytest.approx([0.0])


def test_the_same_file_is_equal_to_itself_alone():
    first, second = Sensors().files()
    assert first == Sensors().files()[0]
    assert first != second and first != "first" and len({first, second, first}) == 2


def test_whole_numbers_stay_whole_in_an_entry():
    entry = Sensors().files()[0].entry()
    for key in ("rows", "average_rows", "repeats"):
        assert all(type(value) is int for value in entry[key])
    assert entry["rows"][-1] == 1999
    numbers = HeldOutErrors.of(entry | {"rows": [10**6 + i for i in range(2000)]}).entry()["rows"]
    assert numbers[1] == 10**6 + 1  # not rounded to four digits
