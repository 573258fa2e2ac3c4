"""A recipe with [remainder]: what is learned from its rows allows for the error of the model."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import RECIPE

from datagen.recipe import read_recipe
from datagen.simulation import simulate_rows
from soilml.config.remainder import Remainder, RemainderPart
from training.calibration.recalibration import compute_metrics
from training.regressors.lssvm import LSSVM

ROWS, TESTED = 900, 2000


@pytest.fixture
def recipe(tmp_path):
    """Of soils that differ in friction alone; torque has a smooth error of 0.2 N m in each run."""
    text = RECIPE.format(rows=ROWS + TESTED, seed=1)
    for known in ("cohesion = [0.0, 3000.0]\n", "shear_modulus = [0.005, 0.03]\n"):
        assert known in text
        text = text.replace(known, "")
    (tmp_path / "recipe.toml").write_text(text)
    plain = read_recipe(tmp_path / "recipe.toml")
    part = RemainderPart(
        "torque_Nm", 0.2, 0.2, 0.3, 0.6, (0.1, 0.5), (40.0, 110.0),
        ((0.3, 70.0),), (2.0,), ((0.2,),), ((0.1,),),
    )  # fmt: skip
    return replace(plain, case=replace(plain.case, remainder=Remainder((part,))))


def learned(recipe, first, last):
    """Features and targets (rows, ...) of rows of a recipe that the soil carries."""
    rows = simulate_rows(recipe, 0, first, last)
    good = rows["status"] == "ok"
    x = np.column_stack([rows["slip"], rows["torque_Nm"] / rows["load_N"], np.log(rows["load_N"])])
    y = np.column_stack([rows["friction_angle_rad"]])
    return x[good], y[good]


@pytest.mark.slow
def test_intervals_allow_for_the_error_of_the_model(recipe):
    """Trained on such rows they hold the truth as often as stated, or more (of a uniform prior)."""
    exact = replace(recipe, case=replace(recipe.case, remainder=None))
    x, y = learned(recipe, ROWS, ROWS + TESTED)
    covered = []
    for trained_on in (recipe, exact):
        found = LSSVM().fit(*learned(trained_on, 0, ROWS))
        figures = compute_metrics(y, *found.predict(x, return_std=True), np.ones(1))
        covered.append(float(figures.cover90[0]))
    assert covered[0] > 0.86
    assert covered[1] < 0.6  # trained on rows of the model alone
