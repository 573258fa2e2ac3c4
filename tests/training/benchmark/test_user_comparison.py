"""The comparison: every method on the same sets, scored alike."""

import csv

import numpy as np
import pytest
from conftest import MODEL, RECIPE

from soilml import Estimator, read_case, read_table
from soilml.cli import main
from soilml.identification import METHODS
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
def lines(test_data, small_model):
    case = read_case(test_data / "model.toml")
    table = read_table(test_data / "test.parquet")
    return compare(case, table, {"small": Estimator.load(small_model)}, analytic_sets=25)


def line(lines, rows, method):
    return next(x for x in lines if x.rows == rows and x.method == method)


def test_every_method_is_scored_on_every_size_of_set(lines):
    methods = {"prior", "small", *(f"analytic {method}" for method in METHODS)}
    for rows in (1, 12):
        assert {x.method for x in lines if x.rows == rows} == methods


def test_the_prior_scores_itself(lines):
    prior = line(lines, 1, "prior")
    np.testing.assert_allclose(prior.relative, 1.0, rtol=0.06)
    np.testing.assert_allclose(prior.cover90, 0.9, atol=0.05)
    np.testing.assert_allclose(prior.cover50, 0.5, atol=0.08)


def test_one_reading_says_little_and_twelve_say_much(lines):
    one, twelve = line(lines, 1, "small"), line(lines, 12, "small")
    assert 0.8 < one.relative[0] < 1.02
    assert (twelve.relative < one.relative).all()
    assert (line(lines, 12, "analytic nonlinear").relative < 0.5).all()
    assert (np.abs(one.cover90 - 0.9) < 0.05).all()


def test_methods_that_cannot_answer_from_one_row_say_so(lines):
    for method in ("analytic linear", "analytic newton"):
        assert line(lines, 1, method).failed == line(lines, 1, method).sets
        assert line(lines, 12, method).failed < line(lines, 12, method).sets
    assert np.isnan(line(lines, 12, "analytic linear").rmse[2])  # K is given, not found


def test_the_command_writes_table_picture_and_page(test_data, small_model, capsys):
    out = test_data / "comparison"
    command = ["compare", str(test_data / "model.toml"), str(test_data / "test.parquet")]
    command += [str(small_model), "--out", str(out), "--analytic-sets", "4"]
    assert main(command) == 0
    assert "one reading alone" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "compare.csv").open()))
    assert {r["parameter"] for r in rows} == {
        "cohesion_Pa",
        "friction_angle_rad",
        "shear_modulus_m",
    }
    assert (out / "compare.png").stat().st_size > 10_000
    assert "prior" in (out / "compare.md").read_text()
