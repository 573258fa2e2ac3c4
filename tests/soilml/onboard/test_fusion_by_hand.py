"""Rules of fusion against their equations, evaluated by hand."""

import numpy as np
import pytest
from test_joint_errors import Sensors

from soilml.onboard.fusion_rules import best_linear
from soilml.onboard.joint_errors import (
    DISAGREEMENT,
    JointErrors,
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
