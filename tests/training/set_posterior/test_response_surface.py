"""The response surface approximates the wheel."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.errors import InputError
from soilml.numerics.prior import Prior
from soilml.quantities import SHEAR
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.response_surface import ResponseSettings, check_equilibria, fit_response


def errors(family, response, designs, soils):
    """Errors of the response (designs, soils, 3), and where the wheel is carried in them."""
    designs, rng = family.designs(designs, 99), np.random.default_rng(1)
    x = np.stack([axis.quantile(rng.random(soils)) for axis in family.axes], axis=1)
    true = family.responses(designs, x[None])
    return response.predict(family.features(designs), x) - true, np.isfinite(true).all(axis=2)


def test_the_error_of_the_response_is_as_declared(wheel_posterior):
    family, response = wheel_posterior.family, wheel_posterior.response
    off, _ = errors(family, response, 200, 30)
    rms = np.sqrt(np.nanmean(off**2, axis=(0, 1)))
    assert (rms < 1.5 * response.error).all()
    assert (response.error < 0.05).all()


def family_with(**priors):
    """The packaged wheel with further priors."""
    recipe = read_recipe("wheel")
    case = replace(recipe.case, prior=recipe.case.prior | priors)
    return RecipeFamily.of(replace(recipe, case=case), SHEAR)


def test_loads_that_soils_of_the_prior_do_not_carry_are_refused_before_anything_is_trained():
    check_equilibria(family_with(), 0)
    family, seen = family_with(kphi=Prior(2e3, 1e5, log=True)), []
    with pytest.raises(InputError, match=r"load_N 30 to 120.*kphi 2000 to 100000.*lower the loads"):
        fit_response(family, ResponseSettings(600, 16, 5, 0), lambda *step: seen.append(step))
    assert not seen


def test_designs_and_soils_are_learned_from_where_the_wheel_is_carried():
    family = family_with(kphi=Prior(2e4, 1e6, log=True))
    response = fit_response(family, ResponseSettings(256, 24, 80, 0), lambda *_: None)
    off, carried = errors(family, response, 100, 60)
    assert 0.7 < carried.mean() < 0.95 and carried.all(axis=1).mean() < 0.5
    assert response.carried == pytest.approx(carried.mean(), abs=0.03)
    rms = np.sqrt(np.mean(off[carried] ** 2, axis=0))
    assert (rms < 1.5 * response.error).all() and (response.error < 0.15).all()
    sets = family.sets(50, 16, 1)
    assert len(sets.truth) == 50 and all(np.isfinite(v).all() for v in sets.readings.values())
