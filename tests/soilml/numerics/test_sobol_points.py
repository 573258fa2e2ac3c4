"""The table of Sobol points has the numbers of scipy."""

import numpy as np
import pytest
from scipy.stats import qmc

from soilml.numerics.sobol_points import MOST_DIMENSIONS, POINTS, sobol_points


@pytest.mark.parametrize("dimensions", range(1, MOST_DIMENSIONS + 3))
def test_points_are_those_of_scipy(dimensions):
    points = sobol_points(dimensions)
    assert points.shape == (POINTS, dimensions) and points.dtype == np.float64
    expected = qmc.Sobol(dimensions, scramble=True, rng=7).random(POINTS)
    np.testing.assert_array_equal(points, expected)
