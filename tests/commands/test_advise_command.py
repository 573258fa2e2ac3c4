"""`soilml plan next`, and what `identify` says of the next row."""

import json
from pathlib import Path

import pytest
from conftest import MODEL
from console import printed, rows_of

from soilml.cli import main

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUNS = "run,slip,load_N,torque_Nm\na,0.2,60,2.9\na,0.2,60,2.95\n"


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


def test_the_table_names_the_best_rows_and_what_they_leave(folder, capsys):
    command = ["advise", "model.toml", "runs.csv", "--slip", "0.05,0.6", "--load", "30,60,120"]
    assert main([*command, "--count", "2", "--out", "o.csv", "--picture", "o.png"]) == 0
    assert capsys.readouterr().out.startswith("Measure next: slip 0.6 at 120 N")
    assert (folder / "o.png").read_bytes().startswith(b"\x89PNG")
    rows = rows_of((folder / "o.csv").read_text())
    assert list(rows[0]) == [
        "row", "channels", "slip", "load_N", "cohesion_left", "friction_angle_left",
        "shear_modulus_left", "all_left",
    ]  # fmt: skip
    assert [r["row"] for r in rows] == [
        "best in all", "best for cohesion", "best for friction angle", "best for shear modulus",
        "best repeat", "row 1 of 2", "row 2 of 2",
    ]  # fmt: skip
    by = {r["row"]: r for r in rows}
    assert (by["best repeat"]["slip"], by["best repeat"]["load_N"]) == ("0.2", "60")
    best, repeat = (float(by[row]["cohesion_left"]) for row in ("best for cohesion", "best repeat"))
    assert best < repeat
    assert float(by["row 2 of 2"]["all_left"]) < float(by["row 1 of 2"]["all_left"])


def test_the_posterior_says_what_is_identified_and_what_to_drive_next(folder, capsys):
    command = ["identify", "model.toml", "runs.csv", "--method", "posterior"]
    content = json.loads(printed([*command, "--format", "json"], capsys).out)
    assert [name for name, told in content["identified"].items() if told] == ["shear_modulus"]
    left = content["advice"]["next_for"]["cohesion"]["remaining_fraction"]["cohesion"]
    assert left < content["advice"]["repeat"]["remaining_fraction"]["cohesion"] - 0.2
    # least squares: no samples, no advice
    assert main([*command[:3], "--method", "nonlinear", "--out", "o.json"]) == 0
    assert "identified" not in json.loads((folder / "o.json").read_text())
    by_run = json.loads(printed([*command, "--by", "run", "--format", "json"], capsys).out)
    assert "advice" in by_run["runs"]["a"]
