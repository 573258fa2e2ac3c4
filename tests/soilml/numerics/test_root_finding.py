"""The element-wise root finder against a scalar library one."""

import numpy as np
from scipy.optimize import brentq

from soilml.numerics.root_finding import first_bracket, rising_root


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
