"""The minimum of a smooth function between bounds."""

import numpy as np
import pytest

from soilml.numerics.root_finding import Point, bounded_minimum


def valley(x):
    """Rosenbrock's function, whose minimum is at (1, 1)."""
    a, b = 1.0 - x[0], x[1] - x[0] ** 2
    gradient = np.asarray([-2.0 * a - 400.0 * x[0] * b, 200.0 * b])
    return Point(x, float(a**2 + 100.0 * b**2), gradient, None)


@pytest.mark.parametrize("upper, expected", [(2.0, (1.0, 1.0)), (0.5, (0.5, 0.25))])
def test_the_minimum_is_found_within_bounds_and_at_one(upper, expected):
    bounds = np.full(2, -2.0), np.asarray([upper, 2.0])
    first, curvature = valley(np.asarray([-1.2, 1.0])), np.asarray([800.0, 200.0])
    found = bounded_minimum(valley, first, np.diag(1.0 / curvature), bounds, 1e-12, 200)
    np.testing.assert_allclose(found.x, expected, atol=1e-4)


def test_a_step_to_where_there_is_no_value_is_shortened():
    def refusing(x):
        if abs(x[0] - 1.0) > 0.5:
            raise np.linalg.LinAlgError
        return Point(x, float((x[0] - 1.4) ** 2), 2.0 * (x - 1.4), None)

    first = refusing(np.asarray([0.6]))
    bounds = np.asarray([-5.0]), np.asarray([5.0])
    found = bounded_minimum(refusing, first, np.asarray([[2.0]]), bounds, 1e-12, 50)
    assert found.x[0] == pytest.approx(1.4, abs=1e-5)
