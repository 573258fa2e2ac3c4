"""The command line's contract: arguments, columns, units, exit status."""

import csv
import io
import json

import numpy as np
import pytest
from conftest import MODEL, RECIPE

from soilml.cli import main


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def runs_file(tmp_path, model_file, capsys):
    """Fifteen simulated rows in two runs."""
    assert main(["simulate", str(model_file), "--slip", "0.1:0.5:5", "--load", "40,70,100"]) == 0
    rows = rows_of(capsys.readouterr().out)
    path = tmp_path / "runs.csv"
    lines = ["run,slip,load_N,torque_Nm"]
    for i, r in enumerate(rows):
        lines.append(f"run_{i // 8},{r['slip']},{r['load_N']},{r['torque_Nm']}")
    path.write_text("\n".join(lines) + "\n")
    return path


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
    capsys.readouterr()
    assert main(command) == 0
    assert capsys.readouterr().out == out.read_text()


def test_simulate_leaves_blanks_and_a_reason_where_there_is_no_equilibrium(model_file, capsys):
    assert main(["simulate", str(model_file), "--slip", "0.2", "--load", "60,1e6"]) == 0
    good, bad = rows_of(capsys.readouterr().out)
    assert good["status"] == "ok"
    assert bad["torque_Nm"] == bad["sinkage_m"] == bad["drawbar_pull_N"] == ""
    assert "no equilibrium" in bad["status"]


@pytest.mark.slow
def test_estimate_leaves_rows_without_a_reading_blank(tmp_path, small_model, capsys):
    text = "run,slip,load_N,torque_Nm\na,0.2,60,\na,0.3,60,3.0\nb,0.4,80,4.9\n"
    (tmp_path / "runs.csv").write_text(text)
    assert main(["estimate", str(small_model), str(tmp_path / "runs.csv")]) == 0
    captured = capsys.readouterr()
    first, second, _ = rows_of(captured.out)
    assert first["cohesion_Pa"] == first["cohesion_Pa_std"] == "" and first["in_range"] == "0"
    assert float(second["cohesion_Pa"]) > 0 and second["in_range"] == "1"
    assert "line 2" in captured.err
    assert main(["estimate", str(small_model), str(tmp_path / "runs.csv"), "--by", "run"]) == 0
    assert [r["rows"] for r in rows_of(capsys.readouterr().out)] == ["1", "1"]


def test_simulated_rows_can_be_identified(model_file, tmp_path, capsys):
    out = str(tmp_path / "sim.csv")
    command = ["simulate", str(model_file), "--slip", "0.1:0.6:6", "--load", "40,90"]
    assert main([*command, "--run", "sim", "--out", out]) == 0
    assert (
        main(["identify", str(model_file), out, "--method", "nonlinear", "--format", "json"]) == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"]["shear_modulus"]["value"] == pytest.approx(0.025, rel=1e-3)


def test_identify_each_run_on_its_own(model_file, runs_file, capsys):
    command = ["identify", str(model_file), str(runs_file), "--method", "posterior"]
    assert main([*command, "--by", "run", "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["by"] == "run" and set(content["runs"]) == {"run_0", "run_1"}
    assert content["runs"]["run_0"]["rows_used"] == 8
    assert main([*command, "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert "runs-as-one-soil" in {one["code"] for one in content["warnings"]}


def test_simulate_takes_braking_slip(model_file, capsys):
    assert main(["simulate", str(model_file), "--slip", "-0.5:0.5:3", "--load", "60"]) == 0
    torque = [float(r["torque_Nm"]) for r in rows_of(capsys.readouterr().out)]
    assert torque[0] < 0 < torque[2]


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
    capsys.readouterr()
    assert main([*command[:-2], "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == content


@pytest.mark.slow
def test_identify_warns_of_one_load(model_file, runs_file, capsys):
    command = ["identify", str(model_file), str(runs_file), "--where", "load_N=40"]
    assert main([*command, "--method", "posterior", "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert ("not-identified", ["cohesion"]) in [
        (w["code"], w["about"]) for w in content["warnings"]
    ]
    assert content["rows_used"] == 5


@pytest.mark.slow
def test_generate_train_estimate_follow_each_other(tmp_path, runs_file, capsys):
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=900, seed=2))
    (tmp_path / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    data, model = str(tmp_path / "data.parquet"), str(tmp_path / "model.onnx")
    command = ["generate", str(tmp_path / "recipe.toml"), data, "--rows", "700", "--seed", "4"]
    assert main(command) == 0
    assert main(["train", str(tmp_path / "spec.toml"), data, model]) == 0
    capsys.readouterr()
    assert main(["estimate", model, str(runs_file)]) == 0
    captured = capsys.readouterr()
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
    assert main(["soils"]) == 0
    listed = capsys.readouterr().out
    assert "wong1989/dry_sand" in listed and "kphi" in listed
    assert main(["soils", "comin2017/es-3"]) == 0
    assert "published as -830" in capsys.readouterr().out
    assert main(["soils", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["wong1989/dry_sand"]["values"]["n"] == 1.1
    assert main(["effects"]) == 0
    listed = capsys.readouterr().out
    for name in ("slip-sinkage", "grousers", "exit-angle", "bulldozing"):
        assert name in listed
    assert main(["effects", "grousers"]) == 0
    assert "height" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [
        "simulate",
        "generate",
        "train",
        "estimate",
        "identify",
        "compare",
        "soils",
        "effects",
        "paper climb",
        "pull",
        "plan next",
    ],
)
def test_help_teaches_with_an_example(command, capsys):
    assert main([*command.split(), "--help"]) == 0
    assert f"soilml {command}" in capsys.readouterr().out.split("positional")[0]


def test_the_root_lists_every_command_in_the_order_of_work(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    places = [
        said.index(f"    {c} ")
        for c in ("soils", "simulate", "identify", "generate", "train", "estimate", "compare")
    ]
    assert places == sorted(places)


def test_model_file_of_the_contract(tmp_path, capsys):
    text = MODEL + '[[effect]]\nname = "slip-sinkage"\nn1 = 0.4\n'
    text = text.replace("[soil.prior]", "friction_angle = 0.60\n[soil.prior]")
    (tmp_path / "m.toml").write_text(text)
    command = ["simulate", str(tmp_path / "m.toml"), "--slip", "0.1,0.5", "--load", "60"]
    assert main(command) == 0
    first, last = rows_of(capsys.readouterr().out)
    assert float(last["sinkage_m"]) > 1.4 * float(first["sinkage_m"])
