"""The comparison on test data: every method scored on the same sets."""

import csv
import json

import pytest
from conftest import MODEL, RECIPE

from soilml.cli import main


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
