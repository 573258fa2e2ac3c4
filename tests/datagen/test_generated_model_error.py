"""[remainder] of a recipe: its mean and one draw of its error a run are in the generated rows."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import RECIPE

from datagen.recipe import read_recipe
from datagen.simulation import model_error, sample_rows, simulate_rows
from soilml.config.remainder import Remainder, RemainderPart


@pytest.fixture
def recipe(tmp_path):
    """A recipe with eight rows a run, and a remainder of the torque."""
    (tmp_path / "recipe.toml").write_text(
        RECIPE.format(rows=64, seed=1) + "[[runs]]\nrows = 8\nshare = 1.0\n"
    )
    plain = read_recipe(tmp_path / "recipe.toml")
    part = RemainderPart(
        column="torque_Nm",
        gear="",
        amplitude=0.2,
        usual=0.1,
        slip_length=0.3,
        log_load_length=0.6,
        slip=(0.1, 0.5),
        load=(40.0, 110.0),
        points=((0.2, 60.0), (0.5, 60.0)),
        mean=(1.5, -0.5),
        known=((0.9, 0.0), (0.0, 0.5)),
        shared=((0.1,), (0.2,)),
    )
    return replace(plain, case=replace(plain.case, remainder=Remainder((part,))))


def test_generated_rows_are_the_model_its_mean_and_the_error(recipe):
    exact = replace(recipe, bias={}, case=replace(recipe.case, noise={}))
    rows, sampled = simulate_rows(exact, 0, 0, 64), sample_rows(exact, 0, 0, 64)
    bare = simulate_rows(replace(exact, case=replace(exact.case, remainder=None)), 0, 0, 64)
    mean, _ = recipe.case.remainder.mean_and_std("torque", sampled.slip, sampled.load)
    added = rows["torque_Nm"] - bare["torque_Nm"]
    error = model_error(recipe, 0, sampled, sampled.run)["torque_Nm"]
    np.testing.assert_allclose(added, mean + error, rtol=1e-9, atol=1e-12)
    assert np.std(error) > 0.05
    np.testing.assert_array_equal(rows["sinkage_m"], bare["sinkage_m"])
