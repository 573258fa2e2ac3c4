"""`soilml compare`: methods on the same sets, and where training differs from the test data."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL, RECIPE

from datagen.recipe import read_recipe
from soilml import Estimator, read_case, read_table
from soilml.cli import main
from soilml.errors import InputError
from soilml.identification import METHODS
from soilml.numerics.prior import Prior
from training.benchmark import comparison
from training.benchmark.comparison import MethodResult, check_same_provenance, sets_of_recipe
from training.benchmark.methods import LIMIT, Method

EXPORTED = Path(__file__).parents[3] / "exported"
NAMES = ("cohesion", "friction_angle", "shear_modulus")
ANALYTIC = {f"analytic {name}" for name in METHODS}


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Slow methods have eight sets at most."""
    monkeypatch.setattr(comparison, "ANALYTIC_SECONDS", 0.0)
    monkeypatch.setattr(comparison, "ANALYTIC_SETS", 8)


@pytest.fixture(scope="module")
def test_data(tmp_path_factory):
    from datagen.generate import generate

    folder = tmp_path_factory.mktemp("test")
    blocks = "[[runs]]\nrows = 1\nshare = 0.4\n[[runs]]\nrows = 12\nshare = 0.6\n"
    text = RECIPE.replace('"2 %"\n', '"2 %"\nsinkage_m = 0.0005\n')
    (folder / "recipe.toml").write_text(text.format(rows=1500, seed=31) + blocks)
    (folder / "model.toml").write_text(MODEL + "sinkage_m = 0.0005\n")
    generate(read_recipe(folder / "recipe.toml"), folder / "test.parquet")
    return folder


@pytest.mark.long
def test_the_command_writes_table_picture_and_page(test_data, small_model, capsys):
    out = test_data / "comparison"
    command = ["compare", str(test_data / "model.toml"), str(test_data / "test.parquet")]
    command += [str(small_model), "--out", str(out)]
    assert main(command) == 0
    assert capsys.readouterr().out.startswith("From 1 reading, ")
    rows = list(csv.DictReader((out / "compare.csv").read_text().splitlines()))
    assert {r["parameter"] for r in rows} == {
        "cohesion_Pa",
        "friction_angle_rad",
        "shear_modulus_m",
    }
    assert {r["method"] for r in rows} == {"prior", "small", *ANALYTIC}
    assert (out / "compare.png").stat().st_size > 10_000
    assert "Comparison of methods" in (out / "report.html").read_text()
    content = json.loads((out / "compare.json").read_text())
    assert len(content["columns"]["rmse"]) == len(rows)
    assert content["report"]["kind"] == "compare" and len(content["report"]["files"]) == 3


@pytest.mark.long
def test_without_test_data_the_sets_are_those_of_the_benchmark(small_model, tmp_path, capsys):
    out = tmp_path / "results"
    command = ["compare", str(small_model), "--sets", "3"]
    assert main([*command, "--out", str(out)]) == 0
    rows = list(csv.DictReader((out / "compare.csv").read_text().splitlines()))
    designs = {(int(r["rows_in_set"]), r["one_load"]) for r in rows}
    assert {n for n, _ in designs} == {1, 3, 6, 8, 16, 18} and len(designs) == 10
    limit = [float(r["rmse_over_limit"]) for r in rows if r["method"] == LIMIT]
    assert limit == [1.0] * len(limit)


@pytest.mark.slow
def test_no_released_model_was_trained_on_the_benchmark():
    files = sorted(EXPORTED.glob("*.onnx"))
    seeds = [json.loads(Estimator.load(file).metadata["recipe"]).get("seed") for file in files]
    recipe = read_recipe("benchmark")
    assert files and recipe.seed not in [*seeds, read_recipe("wheel_test").seed]
    lengths = [len(one) for one in sets_of_recipe(recipe)]
    assert [lengths.count(n) for n in (1, 3, 6, 8, 16, 18)] == [700, 200, 200, 200, 200, 150]


def test_figures_of_a_method_by_hand():
    priors = (Prior(0.0, 3000.0),)
    truth = np.asarray([[500.0], [1000.0], [2000.0], [2500.0]])
    estimates = truth[:, None] + np.asarray([100.0, -50.0, 50.0])[:, None]
    estimates[3] = np.nan  # a failed estimate counts as the prior's median
    limit = np.asarray([[50.0], [-50.0]])
    method = Method("own", "", ("torque",), lambda rows: estimates[0])
    found = MethodResult(8, False, method, priors, truth, estimates, 0.0, limit)
    assert found.failed == 1
    np.testing.assert_allclose(found.error[:, 0], [100.0, 100.0, 100.0, -1000.0])
    assert found.coverage[0] == 1.0
    ratio, error = found.over_limit
    assert ratio[0] == pytest.approx(2.0) and error[0] == pytest.approx(0.0)


OTHERS = {
    "soil": (MODEL.replace("dry_sand", "sandy_loam_32"), ", the model file"),
    "bearing": (
        MODEL.replace("[soil.prior]", "kphi = 1e6\n[soil.prior]"),
        "the model file has 1e+06",
    ),
    "effect": (MODEL + '[[effect]]\nname = "slip-sinkage"\nn1 = 0.4\n', "effects none"),
    "prior": (MODEL.replace("3000.0", "6000.0"), "prior [0.0, 3000.0] of cohesion"),
    "scale": (
        MODEL.replace("[0.005, 0.03]", '{ range = [0.005, 0.03], scale = "log" }'),
        "of shear_modulus",
    ),
    "gear": (MODEL.replace('"wheel"', '"linear-wheel"'), "gear type 'wheel'"),
    "wheel": (MODEL.replace("radius = 0.15", "radius = 0.1"), "radius 0.15"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_without_a_recipe_of_the_data_the_training_differences_are_noted(
    tmp_path, small_data, small_model, what
):
    text, fragment = OTHERS[what]
    (tmp_path / "m.toml").write_text(text)
    case, table = read_case(tmp_path / "m.toml"), replace(read_table(small_data), metadata={})
    estimators = {"small": Estimator.load(small_model)}
    if what in ("gear", "wheel"):
        with pytest.raises(InputError, match="compare data and models of one wheel"):
            check_same_provenance(case, table, estimators, NAMES)
    else:
        (note, *_) = check_same_provenance(case, table, estimators, NAMES)
        assert (note.code, note.about) == ("trained-otherwise", ("small",))
        assert fragment in note.text
