"""The comparison on test data: every method scored on the same sets."""

import csv
import json

import numpy as np
import pytest
from conftest import MODEL, RECIPE

from soilml import Estimator, read_case, read_table
from soilml.cli import main
from training.benchmark.user_comparison import compare


@pytest.fixture(scope="module")
def test_data(tmp_path_factory):
    from datagen.generate import generate
    from datagen.recipe import read_recipe

    folder = tmp_path_factory.mktemp("test")
    blocks = "[[runs]]\nrows = 1\nshare = 0.4\n[[runs]]\nrows = 12\nshare = 0.6\n"
    text = RECIPE.replace('"2 %"\n', '"2 %"\nsinkage_m = 0.0005\n')
    (folder / "recipe.toml").write_text(text.format(rows=1500, seed=31) + blocks)
    (folder / "model.toml").write_text(MODEL + "sinkage_m = 0.0005\n")
    generate(read_recipe(folder / "recipe.toml"), folder / "test.parquet")
    return folder


@pytest.fixture(scope="module")
def scores(test_data, small_model):
    case = read_case(test_data / "model.toml")
    table = read_table(test_data / "test.parquet")
    return compare(case, table, {"small": Estimator.load(small_model)}, analytic_sets=2)


def score(scores, rows, method):
    return next(x for x in scores if x.rows == rows and x.method == method)


@pytest.mark.slow
def test_twelve_readings_reduce_the_error_that_one_leaves(scores):
    one, twelve = score(scores, 1, "small"), score(scores, 12, "small")
    assert 0.8 < one.rmse_over_prior[0] < 1.02
    assert (twelve.rmse_over_prior < one.rmse_over_prior).all()
    assert (score(scores, 12, "analytic nonlinear").rmse_over_prior < 0.5).all()
    assert (np.abs(one.coverage90 - 0.9) < 0.05).all()


@pytest.mark.long
def test_the_command_writes_table_picture_and_page(test_data, small_model, capsys):
    out = test_data / "comparison"
    command = ["compare", str(test_data / "model.toml"), str(test_data / "test.parquet")]
    command += [str(small_model), "--out", str(out), "--analytic-sets", "4"]
    assert main(command) == 0
    assert "single readings" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "compare.csv").read_text().splitlines()))
    assert {r["parameter"] for r in rows} == {
        "cohesion_Pa",
        "friction_angle_rad",
        "shear_modulus_m",
    }
    assert (out / "compare.png").stat().st_size > 10_000
    assert "Comparison of methods" in (out / "report.html").read_text()
    content = json.loads((out / "compare.json").read_text())
    assert len(content["columns"]["rmse"]) == len(rows)
    assert content["report"]["kind"] == "compare" and len(content["report"]["files"]) == 3
