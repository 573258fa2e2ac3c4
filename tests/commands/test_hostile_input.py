"""Input that once ended in a traceback, or was believed: one line, status 2, or a status."""

import json

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml import Model, Operating, Wheel, soil
from soilml.cli import main

HEADER = "run,slip,load_N,torque_Nm,drawbar_pull_N,sinkage_m"


def rows(sinkage=1.0, slip=None):
    """Thirty rows of five runs, as lists of text."""
    rng = np.random.default_rng(0)
    slips, loads = rng.uniform(0.05, 0.6, 30), rng.uniform(30, 120, 30)
    slips = slips if slip is None else np.full(30, slip)
    force = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=slips, load=loads)
    )
    columns = slips, loads, force.torque, force.drawbar_pull, force.sinkage * sinkage
    return [[f"run_{i // 6}", *(f"{c[i]:.7g}" for c in columns)] for i in range(30)]


def table(path, lines, header=HEADER):
    path.write_text("\n".join([header, *(",".join(line) for line in lines)]) + "\n")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "model.toml").write_text(THREE_CHANNEL_MODEL)
    table(tmp_path / "runs.csv", rows())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(words, capsys, said):
    status = main(words)
    captured = capsys.readouterr()
    assert status == 2 and captured.err.count("\n") == 1, captured.err
    assert said in captured.err
    assert captured.out == ""


@pytest.mark.parametrize(("factor", "unit"), [(100.0, "cm"), (1000.0, "mm")])
@pytest.mark.parametrize("method", ["linear", "nonlinear", "posterior", "gap"])
def test_a_sinkage_that_is_not_in_metres(folder, capsys, factor, unit, method):
    table(folder / "other.csv", rows(sinkage=factor))
    words = ["identify", "model.toml", "other.csv", "--method", method]
    if method == "gap":
        words = ["gap", "model.toml", "other.csv", "--out", "found"]
    assert main(words) == 2
    *hints, error = capsys.readouterr().err.splitlines()
    assert "other.csv line 2, column sinkage_m" in error
    assert all(hint.startswith("! ") for hint in hints)


def test_numbers_beyond_what_a_rover_can_meet_name_row_and_column(folder, capsys):
    for column, value in (
        (2, "2e7"), (2, "1e-7"), (3, "1e308"), (3, "-1e8"), (4, "1e9"), (5, "11"),
    ):  # fmt: skip
        lines = rows()
        lines[4][column] = value
        table(folder / "other.csv", lines)
        name = HEADER.split(",")[column]
        for words in (
            ["identify", "model.toml", "other.csv"],
            ["audit", "model.toml", "other.csv"],
        ):
            refused(words, capsys, f"other.csv line 6, column {name}: ")


@pytest.mark.parametrize(
    ("column", "value"), [("pass", "0"), ("pass", "0.5"), ("speed_m_s", "101"),
                          ("slip_angle_rad", "2"), ("torque_Nm_std", "1e300")],
)  # fmt: skip
def test_covariates_beyond_their_bounds_name_row_and_column(folder, capsys, column, value):
    table(folder / "other.csv", [[*line, value] for line in rows()], f"{HEADER},{column}")
    refused(["identify", "model.toml", "other.csv"], capsys, f"other.csv line 2, column {column}")


def test_noise_that_no_sensor_has_is_bad_data(folder, capsys):
    text = THREE_CHANNEL_MODEL.replace('torque_Nm = "2 %"', "torque_Nm = 1e-9")
    (folder / "exact.toml").write_text(text)
    assert main(["gap", "exact.toml", "runs.csv", "--out", "found"]) == 3
    assert json.loads((folder / "found" / "gap.json").read_text())["status"] == "bad-data"
    assert "bad-data: the noise of torque_Nm" in capsys.readouterr().out


@pytest.mark.parametrize(
    "setting", ['slip = "1e300 %"', "speed_m_s = 1e300", 'load_N = "1e4%+1e10"']
)
def test_noise_beyond_any_reading(folder, capsys, setting):
    (folder / "noisy.toml").write_text(f"{THREE_CHANNEL_MODEL}{setting}\n")
    refused(["identify", "noisy.toml", "runs.csv"], capsys, "noisy.toml [noise]: ")


@pytest.mark.parametrize(
    "text",
    [".".join("a" * 1000) + " = 1", ".".join("a" * 50) + " = 1", "a = " + "[" * 50 + "]" * 50,
     "a = " + "[" * 5000 + "]" * 5000],
)  # fmt: skip
def test_settings_nested_too_deep(folder, capsys, text):
    (folder / "deep.toml").write_text(f"{text}\n{THREE_CHANNEL_MODEL}")
    words = ["simulate", "deep.toml", "--slip", "0.1", "--load", "60"]
    refused(words, capsys, "nested too deep")


@pytest.mark.parametrize("option", ["--slip=--", "--load=--", "--out=--", "--speed=--"])
def test_an_option_whose_value_is_two_dashes(folder, capsys, option):
    """argparse turns it into an empty list."""
    words = ["simulate", "model.toml", "--slip", "0.1", "--load", "60", option]
    refused(words, capsys, f"{option}: needed is a value")


def test_a_label_is_a_name(folder, capsys):
    words = ["simulate", "model.toml", "--slip", "0.1", "--load", "60"]
    for label in ("\x1b[2J", "a" * 300):
        refused([*words, "--run", label], capsys, "--run")


@pytest.mark.slow
def test_the_report_shows_names_as_text(folder):
    lines = [["<script>alert(1)</script>", *line[1:]] for line in rows()[:15]]
    table(folder / "odd.csv", lines + rows()[15:])
    assert main(["gap", "model.toml", "odd.csv", "--out", "found"]) == 0
    assert "<script>alert" not in (folder / "found" / "report.html").read_text()
