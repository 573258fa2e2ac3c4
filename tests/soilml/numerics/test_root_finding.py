"""Roots against a scalar library finder, and minima between bounds."""

import numpy as np
import pytest
from scipy.optimize import brentq

from soilml.numerics.root_finding import Point, bounded_minimum, first_bracket, rising_root


def test_finds_every_root_of_a_batch_of_steep_and_flat_functions():
    rng = np.random.default_rng(0)
    power, place = rng.uniform(0.3, 5.0, 400), rng.uniform(-6.0, 2.0, 400)

    def f(x):
        return np.log(0.1 + np.exp(power * (x - place))) - np.log(1.1)

    low, high = np.full(400, -20.0), np.full(400, 5.0)
    root = rising_root(f, low, high, np.full(400, 0.0), np.full(400, 1.0))
    assert root.converged.all()
    for i in range(0, 400, 37):
        exact = brentq(
            lambda x, i=i: np.log(0.1 + np.exp(power[i] * (x - place[i]))) - np.log(1.1), -20, 5
        )
        assert abs(root.x[i] - exact) < 1e-9


def test_the_bracket_is_that_of_the_first_of_several_crossings():
    grid = np.linspace(0.1, 9.0, 200)[:, None]
    low, high, exists, _ = first_bracket(lambda x: np.sin(x) - 0.5, grid)
    assert exists.all()
    assert low[0] < np.pi / 6 <= high[0]
    _, _, exists, peak = first_bracket(lambda x: np.sin(x) - 1.5, grid)
    assert not exists.any()
    assert abs(np.sin(grid[peak[0], 0]) - 1.0) < 1e-3


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
