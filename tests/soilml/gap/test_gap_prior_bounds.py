"""The posterior between the bounds of the soil's priors, against numerical integration."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem
from scipy.integrate import quad

from soilml.gap.evidence.marginal_likelihood import outside_bounds
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.physics.effects import EFFECTS


@pytest.fixture(scope="module")
def soil():
    case = case_of()
    table = driven(case, [EFFECTS["slip-sinkage"](n1=0.2)], seed=2)
    return fit_problem(case, table).fit_soil([np.full(3, 0.5)])


def by_integration(at, gradient, precision):
    """-2 ln of the integral of a normal likelihood over the uniform prior, over Laplace's."""

    def likelihood(t):
        return np.exp(gradient * (t - at) - 0.5 * (precision - UNIFORM_PRECISION) * (t - at) ** 2)

    laplace = np.sqrt(2 * np.pi / precision)
    if at not in (0.0, 1.0):  # a coordinate at a bound stays there
        laplace *= np.exp(0.5 * gradient**2 / precision)
    return -2.0 * np.log(quad(likelihood, 0.0, 1.0, points=[at], limit=200)[0] / laplace)


@pytest.mark.parametrize(
    ("at", "gradient"),
    [(0.5, 0.0), (0.9, 5.0), (0.0, -10.0), (0.0, -900.0), (0.0, 3.0), (1.0, 30.0), (1.0, 300.0)],
)
@pytest.mark.parametrize("precision", [12.0, 30.0, 900.0])
def test_the_factor_of_each_coordinate_is_that_of_integration(soil, at, gradient, precision):
    fit = replace(soil, x=np.asarray([0.5, at, 0.5]))
    curvature = np.diag([1e9, precision, 1e9])  # the others are far inside their priors
    expected = by_integration(at, gradient, precision)
    found = outside_bounds(fit, np.asarray([0.0, gradient, 0.0]), curvature)
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_a_further_effect_that_relieves_a_bound_is_counted(soil):
    fit = replace(soil, x=np.asarray([0.5, 1.0, 0.5]))
    curvature = np.diag([1e8, 100.0, 1e8, 1.0])
    pressed = outside_bounds(fit, np.asarray([0.0, 30.0, 0.0, 0.0]), curvature)
    curvature[1, 3] = curvature[3, 1] = 9.0  # the effect changes the readings as the soil does
    relieved = outside_bounds(fit, np.asarray([0.0, 30.0, 0.0, 3.3]), curvature)
    assert relieved < pressed - 1.0


def test_a_neighbour_that_its_bound_holds_does_not_move(soil):
    """The second coordinate has its own curvature, the first what the second leaves it."""
    fit = replace(soil, x=np.asarray([0.0, 0.9, 0.5]))
    gradient, curvature = np.asarray([-20.0, 4.0, 0.0]), np.diag([400.0, 200.0, 1e9])
    curvature[0, 1] = curvature[1, 0] = 150.0
    first = 400.0 - 150.0**2 / 200.0
    expected = by_integration(0.0, -20.0 - 150.0 / 200.0 * 4.0, first)
    expected += by_integration(0.9, 4.0, 200.0)
    assert outside_bounds(fit, gradient, curvature) == pytest.approx(expected, rel=1e-3, abs=1e-3)
