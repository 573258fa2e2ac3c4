"""What a log gives: runs kept back, ranges with a margin, noise, and a recipe that can be read."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import SlipSinkage, read_case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from training.adaptation.campaign import DrivenRange, recipe_text, split_runs, within_carried_loads
from training.set_posterior.families.recipe_family import RecipeFamily


@pytest.fixture
def case(model_file):
    return read_case(model_file)


def log(runs=8, rows=4, **more):
    """Rows of several runs, each under one load, without a physical meaning."""
    count = runs * rows
    columns = {
        "run": np.repeat([f"r{i}" for i in range(runs)], rows),
        "slip": np.tile(np.linspace(0.1, 0.5, rows), runs),
        "load_N": np.repeat(np.linspace(40.0, 100.0, runs), rows),
        "torque_Nm": np.linspace(1.0, 4.0, count),
    }
    return Table(columns | {name: np.full(count, value) for name, value in more.items()})


def test_whole_runs_are_kept_back_by_the_seed():
    table = log()
    split = split_runs(table, 3)
    assert len(split.runs) == 2 and len(split.kept_back) == 8
    assert not set(split.campaign["run"]) & set(split.kept_back["run"])
    assert len(split.campaign) + len(split.kept_back) == len(table)
    assert split_runs(table, 3).runs == split.runs
    assert len({split_runs(table, seed).runs for seed in range(20)}) > 5


def test_the_recipe_is_read_back_and_suits_a_set_posterior(case, tmp_path):
    model = replace(case.model, effects=(SlipSinkage(n1=0.4),))
    prior = {**case.prior, "slip-sinkage.n1": Prior(0.3, 0.5)}
    own = replace(case, model=model, prior=prior)
    path = tmp_path / "recipe.toml"
    path.write_text(recipe_text(own, DrivenRange.of(log(), case), 5000, 7))
    recipe = read_recipe(path)
    assert (recipe.rows, recipe.seed) == (5000, 7)
    assert (recipe.slip.lower, recipe.load.upper) == pytest.approx((0.05, 120.0))
    assert recipe.case.prior == prior and recipe.case.model == model
    family = RecipeFamily.of(recipe, ("cohesion", "friction_angle", "shear_modulus"))
    assert len(family.axes) == 4


def test_loads_end_where_most_soils_carry_no_more(case):
    driven = DrivenRange.of(log(), case)
    assert within_carried_loads(driven, case, 0) == (driven, [])
    soft = replace(case, prior=case.prior | {"kphi": Prior(4e3, 1e5, log=True)})
    narrowed, (remark,) = within_carried_loads(driven, soft, 0)
    assert driven.load[0] == narrowed.load[0] < narrowed.load[1] < driven.load[1]
    assert within_carried_loads(narrowed, soft, 0) == (narrowed, [])
    assert f"up to {narrowed.load[1]:g} N" in remark.text
    with pytest.raises(InputError, match=r"load_N 300 to 900.*kphi 4000 to 100000"):
        within_carried_loads(replace(driven, load=(300.0, 900.0)), soft, 0)
