"""The released models: whole, from today's recipes, and as good as their cards say."""

import json
from pathlib import Path

import numpy as np
import pytest

from datagen.engine import pieces
from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.quantities import column
from training.spec import read_spec

ROOT = Path(__file__).parents[1]
RELEASED = {
    "wheel": ("wheel", "fused"),
    "wheel_lssvm": ("wheel", "lssvm"),
    "wheel_mlp": ("wheel", "mlp"),
    "wheel_linear": ("wheel", "linear"),
    "kls1_wheel": (str(ROOT / "examples/kls1/recipe.toml"), "fused"),
}


def test_every_released_file_is_listed_and_has_its_card():
    assert {f.stem for f in (ROOT / "exported").glob("*.onnx")} == set(RELEASED)
    page = (ROOT / "exported" / "README.md").read_text()
    for name in RELEASED:
        assert (ROOT / "exported" / f"{name}.md").is_file()
        assert f"{name}.onnx" in page


@pytest.mark.parametrize("name", RELEASED)
def test_comes_from_the_recipe_and_spec_in_the_tree(name):
    recipe, spec = RELEASED[name]
    metadata = Estimator.load(ROOT / "exported" / f"{name}.onnx").metadata
    assert metadata["recipe_sha256"] == read_recipe(recipe).sha256
    assert metadata["spec"] == read_spec(spec).text
    assert float(metadata["parity"]) < 1e-4
    card = (ROOT / "exported" / f"{name}.md").read_text()
    assert metadata["data_sha256"] in card


@pytest.mark.parametrize("name", RELEASED)
def test_is_as_good_on_another_seed_as_its_card_says(name):
    estimator = Estimator.load(ROOT / "exported" / f"{name}.onnx")
    recipe = read_recipe(RELEASED[name][0]).sized(12000, seed=4242)
    rows = next(pieces(recipe))
    alone = np.char.startswith(rows["run"], "1x")
    readings = {n: rows[column(n)][alone] for n in estimator.inputs}
    truth = np.stack([rows[column(n)][alone] for n in estimator.names], axis=1)
    found = estimator(**readings)
    metrics = json.loads(estimator.metadata["metrics"])["estimator"]
    relative = np.sqrt(np.mean((found.mean - truth) ** 2, axis=0)) / estimator.prior.std
    np.testing.assert_allclose(relative, metrics["rmse_share_of_prior"], atol=0.035)
    inside = np.mean((truth >= found.low) & (truth <= found.high), axis=0)
    assert (np.abs(inside - 0.9) < 0.02).all()
    assert found.in_range.mean() > 0.995
