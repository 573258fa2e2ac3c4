"""The line through predicted and measured."""

import numpy as np
import pytest
from scipy import stats

from soilml.errors import FitError, InputError
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


def test_a_perfect_line_explains_all_and_no_line_is_refused():
    line = linear_regression([1.0, 2.0, 4.0], [3.0, 5.0, 9.0])
    assert (line.slope, line.intercept) == pytest.approx((2.0, 1.0))
    assert line.r2 == pytest.approx(1.0) and line.f > 1e12
    with pytest.raises(FitError, match="no regression line"):
        linear_regression([1.0, 1.0, 1.0], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="three or more"):
        linear_regression([1.0, 2.0], [1.0, 2.0])
    with pytest.raises(InputError, match="finite"):
        linear_regression([1.0, 2.0, np.nan], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="one length"):
        linear_regression([1.0, 2.0, 3.0], [1.0, 2.0])
