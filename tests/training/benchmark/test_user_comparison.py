"""`soilml compare`: methods on the same sets, and where training differs from the test data."""

import csv
import json
from dataclasses import replace

import pytest
from conftest import MODEL, RECIPE

from soilml import Estimator, read_case, read_table
from soilml.cli import main
from soilml.errors import InputError
from training.benchmark.bayes_limit import UNMODELLED_EFFECTS
from training.benchmark.methods import (
    ANALYTIC_PREFIX,
)
from training.benchmark.suite import (
    ANALYTIC_METHODS,
    LIMIT_LABEL,
    POSTERIOR_LABEL,
)
from training.benchmark.user_comparison import check_same_provenance


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


@pytest.mark.long
def test_the_command_writes_tables_figure_and_goals(small_model, tmp_path, capsys):
    out = tmp_path / "results"
    assert main(["compare", str(small_model), "--sets", "1", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "18 rows, three loads, slips in a grid" in printed and "Bayes limit" in printed
    rows = list(csv.DictReader((out / "benchmark.csv").read_text().splitlines()))
    assert {r["method"] for r in rows} == {
        LIMIT_LABEL,
        POSTERIOR_LABEL,
        "prior",
        "small",
        *(f"{ANALYTIC_PREFIX}{name}" for name in ANALYTIC_METHODS),
    }
    assert {r["unknown_effect"] for r in rows} == {"", *UNMODELLED_EFFECTS}
    assert (out / "benchmark.png").stat().st_size > 20_000
    assert "Acceptance goals" in (out / "report.html").read_text()
    content = json.loads((out / "benchmark.json").read_text())
    assert content["report"]["answer"][0].endswith("acceptance goals are met.")
    assert max(map(len, printed.splitlines())) <= 100


NAMES = ("cohesion", "friction_angle", "shear_modulus")


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


@pytest.fixture
def parts(tmp_path, small_data, small_model):
    table = read_table(small_data)
    return table.rows(slice(0, 100)), {"small": Estimator.load(small_model)}


def case_of(tmp_path, text):
    (tmp_path / "m.toml").write_text(text)
    return read_case(tmp_path / "m.toml")


@pytest.mark.parametrize("what", OTHERS)
def test_without_a_recipe_of_the_data_the_training_differences_are_noted(tmp_path, parts, what):
    text, fragment = OTHERS[what]
    table, estimators = parts
    case, table = case_of(tmp_path, text), replace(table, metadata={})
    if what in ("gear", "wheel"):
        with pytest.raises(InputError, match="compare data and models of one wheel"):
            check_same_provenance(case, table, estimators, NAMES)
    else:
        (note, *_) = check_same_provenance(case, table, estimators, NAMES)
        assert (note.code, note.about) == (
            "trained-otherwise",
            ("small",),
        ) and fragment in note.text
