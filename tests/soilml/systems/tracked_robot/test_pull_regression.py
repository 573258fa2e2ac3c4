"""The line through predicted and measured."""

import numpy as np
import pytest
from scipy import stats

from soilml.systems.tracked_robot.group_identification import linear_regression


def test_the_line_is_that_of_scipy():
    rng = np.random.default_rng(0)
    x = rng.uniform(100.0, 700.0, 18)
    y = 1.13 * x - 30.0 + 60.0 * rng.standard_normal(18)
    ours, theirs = linear_regression(x, y), stats.linregress(x, y)
    assert ours.slope == pytest.approx(theirs.slope)
    assert ours.intercept == pytest.approx(theirs.intercept)
    assert ours.r2 == pytest.approx(theirs.rvalue**2)
    assert ours.slope_std == pytest.approx(theirs.stderr)
    assert stats.f.sf(ours.f, 1, 16) == pytest.approx(theirs.pvalue, rel=1e-6)
    assert ours.points == 18
