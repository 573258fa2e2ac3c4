"""`soilml pull`: from a table of rows to a band of pull and a slope."""

import numpy as np
import pytest
from conftest import MODEL
from console import rows_of

from soilml import Operating, read_case
from soilml.cli import main

pytestmark = pytest.mark.slow

ROWS = "run,slip,load_N,torque_Nm\na,0.2,60,{}\na,0.4,60,{}\n"
COMMAND = ["pull", "model.toml", "runs.csv", "--load", "60", "--slip-limit", "0.4"]


@pytest.fixture
def folder(workplace):
    """A model file, and two rows without noise on a soil of its prior."""
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(ROWS.format(*torque(workplace)))
    return workplace


def truth(folder, slip):
    case = read_case(folder / "model.toml")
    case = case.with_values({"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012})
    return case.model(case.soil, Operating(slip=slip, load=60.0))


def torque(folder):
    return truth(folder, np.asarray([0.2, 0.4])).torque.round(3)


def test_curves_picture_and_words_agree_and_hold_the_truth(folder, capsys):
    files = ["--out", "pull.csv", "--picture", "pull.png"]
    for name in files[1::2]:
        (folder / name).write_text("to be written over")
    assert main([*COMMAND, *files]) == 0
    said = capsys.readouterr().out
    assert (folder / "pull.png").read_bytes().startswith(b"\x89PNG")
    rows = rows_of((folder / "pull.csv").read_text())
    column = {k: np.asarray([float(r[k]) for r in rows]) for k in rows[0]}
    assert column["slip"][-1] == 0.4 and set(column["load_N"]) == {60.0}
    pull = truth(folder, column["slip"]).drawbar_pull
    inside = (column["drawbar_pull_N_p05"] < pull) & (pull < column["drawbar_pull_N_p95"])
    assert inside.all()
    for name in ("drawbar_pull_N", "steepest_slope_rad"):
        assert (column[f"{name}_prior_p05"] < column[f"{name}_p05"]).all()
        assert (column[f"{name}_p95"] < column[f"{name}_prior_p95"]).all()
    assert (column["margin_N_at_10_deg_p95"] > column["margin_N_at_15_deg_p05"]).all()
    efficiency = [column[f"tractive_efficiency{end}"] for end in ("_p05", "", "_p95")]
    assert (efficiency[0] < efficiency[1]).all() and (efficiency[1] < efficiency[2]).all()
    true = truth(folder, column["slip"])
    drive = (1.0 - column["slip"]) * 0.15 * true.drawbar_pull / true.torque
    assert ((efficiency[0] < drive) & (drive < efficiency[2])).all()
    said = " ".join(said.split())
    assert (
        said.startswith("At 60 N the wheel pulls ") and "The best slip on level ground is" in said
    )
    assert "torque alone hardly reveals" in said


def test_loads_and_slopes_are_refused_before_the_posterior(folder, capsys, monkeypatch):
    monkeypatch.setattr("soilml.traction.workflow.measured_soil", None)
    for option, value in (("--load", "60,-5"), ("--slope", "80")):
        assert main([*COMMAND, option, value]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_one_group_is_one(folder, capsys):
    assert main([*COMMAND, "--by", "run", "--exact-model"]) == 0
    assert capsys.readouterr().out.startswith("One group of rows has a prediction.")
