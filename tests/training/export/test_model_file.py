"""From a trained estimator to its file: parity, reproducibility, versions."""

import json

import numpy as np
import pytest
from conftest import RECIPE
from onnx.reference import ReferenceEvaluator
from trained_by_text import trained_by

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.onboard.features import compute_features
from training.export.model_file import export_model

pytestmark = pytest.mark.slow

MEMBERS = {
    "fixed-size-lssvm": '[[regressor]]\ntype = "fixed-size-lssvm"\ncentres = 40\n',
    "mlp": '[[regressor]]\ntype = "mlp"\nhidden = [16, 16]\nepochs = 6\n',
    "linear": '[[regressor]]\ntype = "linear"\n',
}
MEMBERS["fused"] = "".join(MEMBERS.values())


@pytest.fixture(scope="module")
def few_rows(tmp_path_factory):
    folder = tmp_path_factory.mktemp("few")
    (folder / "recipe.toml").write_text(RECIPE.format(rows=1200, seed=9))
    generate(read_recipe(folder / "recipe.toml"), folder / "data.parquet")
    return folder / "data.parquet"


@pytest.mark.parametrize("text", MEMBERS.values(), ids=MEMBERS)
def test_the_file_agrees_with_the_original_over_the_whole_box(tmp_path, few_rows, text):
    original = trained_by(text, few_rows, tmp_path)
    metadata = export_model(original, tmp_path / "m.onnx", few_rows)
    estimator = Estimator.load(tmp_path / "m.onnx")
    rng = np.random.default_rng(0)
    readings = {
        entry["name"]: rng.uniform(entry["lower"], entry["upper"], 4000)
        for entry in json.loads(metadata["inputs"])
    }
    found = estimator(**readings)
    mean, std, inside = original.predict(compute_features(original.spec.features, readings))
    same = found.in_range == inside
    assert same.mean() > 0.999
    assert 0.1 < inside.mean() < 1.0
    off = np.maximum(np.abs(found.mean - mean), np.abs(found.std - std)) / original.prior.std
    assert off[same].max() < 1e-4
    assert off[same].max() <= max(3.0 * float(metadata["parity"]), 1e-6)


def test_a_second_runtime_agrees(tmp_path, few_rows):
    original = trained_by(MEMBERS["fused"], few_rows, tmp_path)
    export_model(original, tmp_path / "m.onnx", few_rows)
    estimator = Estimator.load(tmp_path / "m.onnx")
    reference = ReferenceEvaluator(str(tmp_path / "m.onnx"))
    rng = np.random.default_rng(1)
    readings = {
        "slip": rng.uniform(0.1, 0.5, 50),
        "torque": rng.uniform(1.0, 5.0, 50),
        "load": rng.uniform(40.0, 100.0, 50),
    }
    feed = {k: v.astype(np.float32) for k, v in readings.items()}
    mean, std = reference.run(["mean", "std"], feed)
    found = estimator(**readings)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-5)
    np.testing.assert_allclose(found.std, std, rtol=1e-5)
