"""What `soilml gap` and `soilml audit` refuse: one line, status 2, and nothing left behind."""

import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml.cli import main

MODEL = THREE_CHANNEL_MODEL.partition("shear_modulus")[0] + '[noise]\ntorque_Nm = "2 %"\n'
#: Two rows: whatever reaches the analysis is bad data at once.
RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\nb,0.3,80,3.0\n"
RATE = MODEL + '[[effect]]\nname = "rate"\na = 0.1\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "quiet.toml").write_text(MODEL[: MODEL.index("[noise]")])
    (tmp_path / "rate.toml").write_text(RATE)
    (tmp_path / "runs.csv").write_text(RUNS)
    many = [
        f"{r},{s},{w},{s * w / 20}"
        for r, w in (("a", 60), ("b", 80))
        for s in (0.1, 0.2, 0.3, 0.4, 0.5)
    ]
    (tmp_path / "many.csv").write_text("\n".join([RUNS.split()[0], *many]) + "\n")
    (tmp_path / "heavy.csv").write_text(RUNS.replace("80", "1e6"))
    (tmp_path / "broken.py").write_text("x = 1 / 0\n")
    (tmp_path / "empty.py").write_text("x = 1\n")
    (tmp_path / "file").write_text("a file\n")
    (tmp_path / "taken" / "gap.json").mkdir(parents=True)
    (tmp_path / "same").mkdir()
    (tmp_path / "same" / "model.toml").write_text(MODEL)
    (tmp_path / "same" / "next_runs.csv").write_text(RUNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def state(folder):
    return {p: p.is_file() and p.read_bytes() for p in sorted(folder.rglob("*"))}


def refused(folder, command, capsys, said):
    before = state(folder)
    status = main(command)
    captured = capsys.readouterr()
    assert status == 2
    assert captured.err.count("\n") == 1 and captured.out == ""
    assert said in captured.err and "Traceback" not in captured.err
    assert state(folder) == before


ROWS = {
    "missing torque": (RUNS.replace(",torque_Nm", "").replace(",1.5", "").replace(",3.0", ""),
                       "torque_Nm is missing"),
    "blank run": (RUNS.replace("b,", ","), "line 3, column run"),
    "slip in percent": (RUNS.replace("0.3", "30"), "as a fraction and not in percent"),
    "noise of nothing": (
        RUNS.replace("torque_Nm", "torque_Nm,torque_Nm_std").replace("1.5", "1.5,1").replace(
            "3.0", "3.0,0"),
        "line 3, column torque_Nm_std",
    ),
    "sinkage in mm": (
        RUNS.replace("torque_Nm", "torque_Nm,sinkage_mm").replace("1.5", "1,9").replace(
            "3.0", "3,9"),
        "sinkage",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", ROWS)
def test_faults_in_measured_rows(folder, capsys, fault):
    text, said = ROWS[fault]
    (folder / "bad.csv").write_text(text)
    refused(folder, ["gap", "model.toml", "bad.csv", "--out", "out"], capsys, said)


OPTIONS = {
    "seed below zero": (
        ["--seed", "-1"],
        "--seed: '-1' given; needed is a whole number, 0 or more",
    ),
    "unknown holdout column": (["--holdout", "pass=2"], "column pass is missing"),
    "holdout of no row": (["--holdout", "load_N=61"], "no row has load_N = 61"),
    "too few runs": (["--holdout", "run"], "needs four runs or more; the table has 2"),
    "unknown parameter": (["--free", "phi"], "'phi': no such parameter"),
    "cost of nothing known": (["--cost", "dance=2"], "cost of 'dance': no such kind of run"),
    "cost of nothing": (["--cost", "reverse=0"], "needed is a number above zero"),
    "checked physics": (["--checked", "bulldozing=1"], "needed is EFFECT=STD, with one of"),
    "checked to nothing": (["--checked", "torque-gain=0"], "must be a number above zero"),
    "broken effects file": (["--effects", "broken.py"], "division by zero"),
    "effects file without one": (["--effects", "empty.py"], "no effect in it"),
}


@pytest.mark.parametrize("fault", OPTIONS)
def test_faults_in_options(folder, capsys, fault):
    options, said = OPTIONS[fault]
    refused(folder, ["gap", "model.toml", "runs.csv", "--out", "out", *options], capsys, said)


OTHERS = {
    "folder that is a file": (
        ["gap", "model.toml", "runs.csv", "--out", "file"],
        "is a file; needed is a folder",
    ),
    "file that is a folder": (["gap", "model.toml", "runs.csv", "--out", "taken"], "gap.json"),
    "over the model": (
        ["gap", "same/model.toml", "runs.csv", "--out", "same"],
        "same/model.toml is an input and would be overwritten",
    ),
    "model without its covariate": (
        ["gap", "rate.toml", "many.csv", "--out", "out"],
        "the effect rate needs the column speed_m_s",
    ),
    "audit without noise": (["audit", "quiet.toml", "runs.csv"], "give [noise] in the model file"),
    "audit of a load too heavy": (
        ["audit", "model.toml", "heavy.csv", "--out", "a.json"],
        "heavy.csv line 3: no equilibrium",
    ),
    "audit into a table": (
        ["audit", "model.toml", "runs.csv", "--out", "a.csv"],
        "must end in .json",
    ),
}


@pytest.mark.parametrize("fault", OTHERS)
def test_other_faults(folder, capsys, fault):
    command, said = OTHERS[fault]
    refused(folder, command, capsys, said)
