"""Training and comparison on several processes: the numbers are those of one."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.processes import FORKS, limited_workers
from soilml.quantities import SHEAR
from training.set_posterior import response_surface, validation
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.monomials import monomial_terms, monomials

pytestmark = pytest.mark.skipif(not FORKS, reason="changes constants in this process")


def of_both(function):
    """A result with one worker and with three."""
    found = []
    for workers in (1, 3):
        with limited_workers(workers):
            found.append(function())
    return found


def test_polynomials_of_designs_are_the_same(monkeypatch):
    monkeypatch.setattr(response_surface, "SIMULATED_AT_A_TIME", 8)
    family = RecipeFamily.of(read_recipe("wheel"), SHEAR)
    terms = monomial_terms(len(family.axes), family.degree[0], family.targets, family.degree[1])
    x = response_surface._points(family, 2 * len(terms), 1)
    designs, seen = family.designs(40, 1), []

    def fit():
        progress = lambda text, done, total: seen.append((done, total))  # noqa: E731
        return response_surface._fit_polynomials(
            family.responses, designs, x, monomials(x, terms), progress
        )

    one, three = of_both(fit)
    for a, b in zip(one, three, strict=True):
        np.testing.assert_array_equal(a, b)
    assert len(one[2]) == 40 and one[2].any()
    assert seen[0] == (0, 40) and seen[-1] == (40, 40) and len(seen) == 12


@pytest.mark.slow
def test_limits_and_figures_of_a_set_posterior_are_the_same(wheel_posterior, monkeypatch):
    monkeypatch.setattr(validation, "LIMIT_SETS", 40)
    monkeypatch.setattr(validation, "FIGURE_SETS", 10)
    monkeypatch.setattr(validation, "LEAST_NEIGHBOURS", 30)
    monkeypatch.setattr(validation, "SET_SIZES", (1, 4, 16))
    family, response = wheel_posterior.family, wheel_posterior.response
    limits = of_both(
        lambda: validation.calibrate_misfit_limits(family, response, lambda *_: None).limits
    )
    np.testing.assert_array_equal(limits[0].readings, limits[1].readings)
    np.testing.assert_array_equal(limits[0].misfit, limits[1].misfit)
    figures = of_both(lambda: validation.validate_posterior(wheel_posterior, lambda *_: None))
    assert list(figures[0]) == list(figures[1]) == [1, 4, 16]
    for one, three in zip(figures[0].values(), figures[1].values(), strict=True):
        assert one.sets == three.sets == 10
        np.testing.assert_array_equal(one.relative, three.relative)
        np.testing.assert_array_equal(one.cover90, three.cover90)
