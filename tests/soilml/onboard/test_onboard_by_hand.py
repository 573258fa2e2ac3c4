"""Small rules of the onboard estimates against their equations, evaluated by hand."""

import numpy as np
import pytest

from soilml.onboard.estimate import Estimate, PriorSummary
from soilml.onboard.narrower_prior import (
    within_box,
)

PRIOR = PriorSummary(
    np.asarray([1.0, 10.0]),
    np.asarray([0.5, 4.0]),
    np.asarray([0.0, 2.0]),
    np.asarray([2.0, 18.0]),
)


def test_a_mean_within_one_and_a_half_standard_deviations_of_an_end_is_at_the_edge():
    mean = np.asarray([[1.49, 10.0], [1.51, 10.0], [1.0, 3.51], [1.0, 3.49], [1.0, 16.6]])
    std = np.broadcast_to([1.0 / 3.0, 1.0], (5, 2))
    found = Estimate.gaussian(
        *(("a", "b"), ("1", "1"), PRIOR, mean, std[..., None] * np.eye(2), std),
        *(np.ones(5, dtype=bool), np.ones(2)),
    )
    at_edge = [[False, False], [True, False], [False, False], [False, True], [False, True]]
    assert found.at_edge.tolist() == at_edge


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
