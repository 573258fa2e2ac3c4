"""The command line's contract: arguments, columns, units, exit status."""

import json

import numpy as np
import pytest
from conftest import MODEL, RECIPE
from console import printed, rows_of, rows_printed

from soilml.cli import main


@pytest.fixture
def runs_file(tmp_path, model_file, capsys):
    """Fifteen simulated rows in two runs."""
    words = ["simulate", model_file, "--slip", "0.1:0.5:5", "--load", "40,70,100"]
    lines = ["run,slip,load_N,torque_Nm"]
    for i, r in enumerate(rows_printed(words, capsys)):
        lines.append(f"run_{i // 8},{r['slip']},{r['load_N']},{r['torque_Nm']}")
    (tmp_path / "runs.csv").write_text("\n".join(lines) + "\n")
    return tmp_path / "runs.csv"


def test_simulate_writes_the_promised_columns(model_file, tmp_path, capsys):
    out = tmp_path / "curve.csv"
    command = ["simulate", str(model_file), "--slip", "0:0.6:13", "--load", "60"]
    assert main([*command, "--out", str(out)]) == 0
    rows = rows_of(out.read_text())
    assert list(rows[0]) == [
        "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m", "entry_angle_rad", "status",
    ]  # fmt: skip
    assert [float(r["slip"]) for r in rows] == pytest.approx(np.linspace(0, 0.6, 13))
    assert {r["status"] for r in rows} == {"ok"}
    assert printed([*command, "--format", "csv"], capsys).out == out.read_text()


def test_simulate_leaves_blanks_and_a_reason_where_there_is_no_equilibrium(model_file, capsys):
    words = ["simulate", model_file, "--slip", "0.2", "--load", "60,1e6"]
    good, bad = rows_printed(words, capsys)
    assert good["status"] == "ok"
    assert bad["torque_Nm"] == bad["sinkage_m"] == bad["drawbar_pull_N"] == ""
    assert "no equilibrium" in bad["status"]


def test_identify_each_run_on_its_own(model_file, runs_file, capsys):
    command = ["identify", str(model_file), str(runs_file), "--method", "posterior"]
    content = json.loads(printed([*command, "--by", "run", "--format", "json"], capsys).out)
    assert content["by"] == "run" and set(content["runs"]) == {"run_0", "run_1"}
    assert content["runs"]["run_0"]["rows_used"] == 8
    content = json.loads(printed([*command, "--format", "json"], capsys).out)
    assert "runs-as-one-soil" in {one["code"] for one in content["warnings"]}


def test_identify_finds_the_model_s_own_soil(model_file, runs_file, tmp_path, capsys):
    out = tmp_path / "found.json"
    free = "cohesion,friction_angle,shear_modulus"
    command = ["identify", str(model_file), str(runs_file), "--free", free]
    command += ["--method", "nonlinear", "--out", str(out)]
    assert main(command) == 0
    content = json.loads(out.read_text())
    assert content["method"] == "nonlinear" and content["rows_used"] == 15
    assert content["parameters"]["cohesion"]["value"] == pytest.approx(1040.0, rel=1e-4)
    assert content["parameters"]["friction_angle"]["unit"] == "rad"
    assert set(content) >= {"method", "parameters", "correlation", "warnings", "rows_used"}
    assert json.loads(printed([*command[:-2], "--format", "json"], capsys).out) == content


def test_identify_takes_the_rows_of_one_gear(workplace, model_file, capsys):
    gear = MODEL.partition("[soil]")[0]
    two = (gear.replace("[gear]", f"[gears.{name}]") for name in ("narrow", "wide"))
    model_file.write_text(MODEL.replace(gear, "\n".join(two)))
    lines = ("run,gear,slip,load_N,torque_Nm", "a,narrow,0.1,60,1", "b,wide,0.2,60,2")
    (workplace / "runs.csv").write_text("\n".join(lines) + "\n")
    words = ["identify", model_file, "runs.csv", "--method", "nonlinear", "--free", "cohesion"]
    by_option = printed([*words, "--gear", "narrow"], capsys).out
    assert printed([*words, "--where", "gear=narrow"], capsys).out == by_option
    assert by_option.startswith("1 row ")


@pytest.mark.slow
def test_generate_train_estimate_follow_each_other(tmp_path, runs_file, capsys):
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=900, seed=2))
    (tmp_path / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    data, model = str(tmp_path / "data.parquet"), str(tmp_path / "model.onnx")
    command = ["generate", str(tmp_path / "recipe.toml"), data, "--rows", "700", "--seed", "4"]
    assert main(command) == 0
    assert main(["train", str(tmp_path / "spec.toml"), data, model]) == 0
    captured = printed(["estimate", model, runs_file, "--format", "csv"], capsys)
    rows = rows_of(captured.out)
    assert len(rows) == 15
    for column in ("cohesion_Pa", "friction_angle_rad", "shear_modulus_m"):
        assert float(rows[0][column]) > 0 and float(rows[0][f"{column}_std"]) > 0
        assert float(rows[0][f"{column}_p05"]) < float(rows[0][f"{column}_p95"])
    assert [r["in_range"] for r in rows].count("1") > 10
    assert "mostly the prior" in captured.err
    out = tmp_path / "estimates.csv"
    assert main(["estimate", model, str(runs_file), "--by", "run", "--out", str(out)]) == 0
    rows = rows_of(out.read_text())
    assert [r["run"] for r in rows] == ["run_0", "run_1"]
    assert [r["rows"] for r in rows] == ["8", "7"]


def test_soils_and_effects_list_their_catalogues(capsys):
    for words, names in {
        "show soils": ("wong1989/dry_sand",),
        "show soils comin2017/es-3": ("published as -830",),
        "show effects": ("slip-sinkage", "grousers", "exit-angle", "bulldozing"),
        "show effects grousers": ("height",),
    }.items():
        listed = printed(words.split(), capsys).out
        assert all(name in listed for name in names)
    listed = json.loads(printed(["show", "soils", "--format", "json"], capsys).out)
    assert listed["wong1989/dry_sand"]["values"]["n"] == 1.1
