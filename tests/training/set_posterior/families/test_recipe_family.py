"""Recipes that a set posterior supports, and the noise of simulated sets."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.errors import InputError
from soilml.quantities import SHEAR
from training.set_posterior.families.recipe_family import RecipeFamily


def recipe_of(folder, text):
    path = folder / "recipe.toml"
    path.write_text(text)
    return read_recipe(path)


def test_braking_is_refused(tmp_path):
    from conftest import RECIPE

    text = RECIPE.format(rows=64, seed=1).replace("slip = [0.05, 0.6]", "slip = [-0.3, 0.6]")
    with pytest.raises(InputError, match="needed are slip above 0"):
        RecipeFamily.of(recipe_of(tmp_path, text), SHEAR)


def test_a_target_without_a_prior_is_refused(tmp_path):
    from conftest import RECIPE

    recipe = recipe_of(tmp_path, RECIPE.format(rows=64, seed=1))
    with pytest.raises(InputError, match="no prior of n"):
        RecipeFamily.of(recipe, ("n",))


def test_simulated_torque_has_the_noise_of_the_recipe(wheel_posterior):
    family = wheel_posterior.family
    sets = family.sets(400, 8, 4)
    true = np.exp(
        family.responses(
            sets.origin.designs.reshape(-1, 2), np.repeat(sets.origin.x, 8, 0)[:, None]
        )[:, 0, 0]
    )
    true = true.reshape(-1, 8) * sets.readings["load"]
    off = (sets.readings["torque"] - true) / sets.readings["torque_std"]
    bias = sets.readings["torque_bias"] / sets.readings["torque_std"]
    assert np.std(off) == pytest.approx(np.sqrt(1.0 + np.mean(bias**2)), rel=0.08)


def test_a_range_of_one_wheel_needs_no_context(wheel_posterior):
    assert wheel_posterior.family.inputs() == {} == wheel_posterior.family.limits()
    rows = wheel_posterior.family.designs(100, 0)
    assert rows.shape == (100, 2) and (rows > 0.0).all()
