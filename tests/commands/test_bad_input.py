"""Bad input: one line on standard error, status 2, nothing left behind."""

import pytest
from conftest import MODEL, RECIPE

from soilml.cli import main

RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.3,80,3.0\n"


@pytest.fixture
def folder(tmp_path, small_model, small_data):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=200, seed=1))
    (tmp_path / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    (tmp_path / "runs.csv").write_text(RUNS)
    (tmp_path / "good.onnx").write_bytes(small_model.read_bytes())
    (tmp_path / "good.parquet").write_bytes(small_data.read_bytes())
    return tmp_path


RUN_FAULTS = {
    "misspelt column": (RUNS.replace("torque_Nm", "torqe_Nm"), "torqe_Nm"),
    "extra column": (
        RUNS.replace("torque_Nm", "torque_Nm,mood").replace("1.5", "1.5,5").replace("3.0", "3,5"),
        "mood",
    ),
    "wrong unit": (RUNS.replace("load_N", "load_kN"), "load is read in N"),
    "text in a number": (RUNS.replace("3.0", "three"), "line 3, column torque_Nm"),
    "NaN": (RUNS.replace("3.0", "NaN"), "line 3, column torque_Nm"),
    "negative load": (RUNS.replace("80", "-80"), "line 3, column load_N"),
    "empty file": ("", "is empty"),
    "no such file": (None, "no such file"),
}

COMMANDS = {
    "identify": ["identify", "model.toml", "bad.csv", "--out", "out.json"],
    "estimate": ["estimate", "good.onnx", "bad.csv", "--out", "out.csv"],
}


def refused(folder, command, capsys, monkeypatch, said):
    """Run in the folder; expect status 2, one line that says `said`, and no new file."""
    monkeypatch.chdir(folder)
    before = sorted(p.name for p in folder.rglob("*"))
    status = main(command)
    captured = capsys.readouterr()
    assert status == 2
    assert captured.err.count("\n") == 1, captured.err
    assert said in captured.err
    assert captured.out == ""
    assert "Traceback" not in captured.err
    assert sorted(p.name for p in folder.rglob("*")) == before


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", RUN_FAULTS)
def test_faults_in_measured_rows(folder, capsys, monkeypatch, command, fault):
    text, said = RUN_FAULTS[fault]
    if text is not None:
        (folder / "bad.csv").write_text(text)
    refused(folder, COMMANDS[command], capsys, monkeypatch, said)


OTHERS = {
    "load no sinkage carries": (
        ["simulate", "model.toml", "--slip", "0.2", "--load", "1e6", "--out", "o.csv"],
        "no equilibrium",
    ),
    "slip of one": (["simulate", "model.toml", "--slip", "1", "--load", "9"], "slip is 1"),
    "negative load": (["simulate", "model.toml", "--slip", "0.1", "--load", "-9"], "load is -9"),
    "no number": (["simulate", "model.toml", "--slip", "a:b:c", "--load", "9"], "start:stop:count"),
    "no model file": (["simulate", "none.toml", "--slip", "0.1", "--load", "9"], "no such file"),
    "missing option": (["simulate", "model.toml", "--slip", "0.1"], "--load"),
    "unknown command": (["simulat"], "simulat"),
    "table under another name": (
        ["simulate", "model.toml", "--slip", "0.1", "--load", "9", "--out", "o.parquet"],
        "must end in .csv",
    ),
    "no such spec": (
        ["train", "fusd", "good.parquet", "o.onnx"],
        "fused, leg_soil, linear, lssvm, mlp, slip",
    ),
    "misspelt key": (["simulate", "typo.toml", "--slip", "0.1", "--load", "9"], "'raduis'"),
    "another wheel": (
        ["compare", "small.toml", "good.parquet", "good.onnx", "--out", "o"],
        "radius 0.15",
    ),
    "out into nowhere": (
        ["simulate", "model.toml", "--slip", "0.1", "--load", "9", "--out", "no/o.csv"],
        "does not exist",
    ),
    "unknown parameter": (["identify", "model.toml", "runs.csv", "--free", "phi"], "phi"),
    "unknown method": (["identify", "model.toml", "runs.csv", "--method", "best"], "best"),
    "no such rows": (["identify", "model.toml", "runs.csv", "--where", "run=z"], "run = z"),
    "where without value": (["identify", "model.toml", "runs.csv", "--where", "run"], "COLUMN="),
    "truncated data": (["train", "spec.toml", "cut.parquet", "o.onnx"], "not a complete Parquet"),
    "data that is no data": (["train", "spec.toml", "runs.csv", "o.onnx"], "cohesion_Pa"),
    "out that is no ONNX": (["train", "spec.toml", "good.parquet", "o.pkl"], "must end in .onnx"),
    "recipe that is none": (["generate", "model.toml", "o.parquet"], "is missing"),
    "rows of nothing": (["generate", "recipe.toml", "o.parquet", "--rows", "0"], "rows is 0"),
    "out that is no Parquet": (["generate", "recipe.toml", "o.csv"], "must end in .parquet"),
    "model that is text": (["estimate", "runs.csv", "runs.csv"], "not a valid ONNX model"),
    "truncated model": (["estimate", "cut.onnx", "runs.csv", "--out", "o.csv"], "cut.onnx"),
    "by no column": (["estimate", "good.onnx", "runs.csv", "--by", "soil"], "column soil"),
    "compare without truth": (
        ["compare", "model.toml", "runs.csv", "good.onnx", "--out", "o"],
        "no truth",
    ),
    "unknown soil": (["soils", "wong1989/wet_sand"], "wet_sand"),
    "unknown effect": (["effects", "sinking"], "sinking"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_other_faults(folder, capsys, monkeypatch, what):
    (folder / "cut.parquet").write_bytes((folder / "good.parquet").read_bytes()[:5000])
    (folder / "cut.onnx").write_bytes((folder / "good.onnx").read_bytes()[:5000])
    (folder / "typo.toml").write_text(MODEL.replace("radius", "raduis"))
    (folder / "small.toml").write_text(MODEL.replace("radius = 0.15", "radius = 0.1"))
    command, said = OTHERS[what]
    refused(folder, command, capsys, monkeypatch, said)


def test_a_log_of_another_wheel_is_refused(folder, capsys, monkeypatch):
    lugs = RUNS.replace("torque_Nm", "torque_Nm,grouser_height_m")
    (folder / "lugs.csv").write_text(lugs.replace("1.5", "1.5,0").replace("3.0", "3.0,0.01"))
    command = ["estimate", "good.onnx", "lugs.csv"]
    refused(folder, command, capsys, monkeypatch, "line 3, column grouser_height_m: 0.01 given")
    text = RUNS.replace("torque_Nm", "torque_Nm,wheel_radius_m")
    (folder / "other.csv").write_text(text.replace("1.5", "1.5,0.1").replace("3.0", "3.0,0.1"))
    for command in (
        ["estimate", "good.onnx", "other.csv"],
        ["identify", "model.toml", "other.csv"],
    ):
        refused(folder, command, capsys, monkeypatch, "line 2, column wheel_radius_m: 0.1 given")
