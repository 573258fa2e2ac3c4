"""[discrepancy] in every command that reads a model file: included, or said to be ignored."""

from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL
from console import printed, rows_of

from soilml import Operating, read_case

DISCREPANCY = '[discrepancy]\ntorque_Nm = "3 %"\ndrawbar_pull_N = 1.5\n'


@pytest.fixture
def folder(workplace):
    """A model file without discrepancy and one with it, and nine rows on a soil of the prior."""
    (workplace / "plain.toml").write_text(MODEL)
    (workplace / "model.toml").write_text(MODEL + DISCREPANCY)
    case = read_case(workplace / "plain.toml")
    true = case.with_values({"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012})
    slip, load = np.tile([0.1, 0.3, 0.5], 3), np.repeat([40.0, 70.0, 110.0], 3)
    torque = true.model(true.soil, Operating(slip=slip, load=load)).torque
    rows = "".join(f"a,{s},{w},{t}\n" for s, w, t in zip(slip, load, torque, strict=True))
    (workplace / "runs.csv").write_text("run,slip,load_N,torque_Nm\n" + rows)
    return workplace


def spoken(capsys, *command):
    return printed([*command, "--format", "csv"], capsys)


@pytest.mark.slow
def test_bands_of_pull_have_the_error_of_the_model_and_say_so(folder, capsys):
    command = ("--load", "60", "--slip-limit", "0.4", "--exact-model")
    wide = spoken(capsys, "pull", "model.toml", "runs.csv", *command)
    details = spoken(capsys, "pull", "model.toml", "runs.csv", *command, "-v")
    said = " ".join(details.err.split())
    assert "the noise and errors of the model (torque" in said and "drawbar pull" in said
    for row in rows_of(wide.out):
        # the error alone is a band of 2 * 1.645 * 1.5 N = 4.9 N; 400 draws tell it within 15 %
        assert float(row["drawbar_pull_N_p95"]) - float(row["drawbar_pull_N_p05"]) > 0.85 * 4.9


REMAINDER = """
[remainder]
format = 1
[[remainder.part]]
column = "torque_Nm"
amplitude = 0.2
usual = 0.1
slip_length = 0.3
log_load_length = 0.6
slip = [0.1, 0.5]
load = [40.0, 110.0]
points = [[0.3, 70.0]]
mean = [1.5]
known = [[0.9]]
shared = [[0.1]]
"""


def test_an_estimate_has_the_mean_and_the_error_of_a_remainder(folder, capsys):
    """Rows with the mean in them get the estimate of rows without it, with wider intervals."""
    (folder / "learned.toml").write_text(MODEL + REMAINDER)
    rows = rows_of(Path("runs.csv").read_text())
    at = (np.asarray([float(row[key]) for row in rows]) for key in ("slip", "load_N"))
    mean = read_case("learned.toml").remainder.mean_and_std("torque", *at)[0]
    for row, added in zip(rows, mean, strict=True):
        row["torque_Nm"] = float(row["torque_Nm"]) + added
    lines = [",".join(str(v) for v in row.values()) for row in rows]
    Path("shifted.csv").write_text("\n".join([",".join(rows[0]), *lines]))
    command = ("--by", "run", "--model")
    words = ("estimate", "any_wheel", "runs.csv", *command, "plain.toml", "--exact-model")
    plain = spoken(capsys, *words)
    wide = spoken(capsys, "estimate", "any_wheel", "shifted.csv", *command, "learned.toml")
    said = "[remainder] of torque_Nm: its mean is taken from the readings, its error is included"
    assert said in wide.err
    assert "[remainder]" not in plain.err
    before, after = rows_of(plain.out)[0], rows_of(wide.out)[0]
    for key in ("cohesion_Pa", "friction_angle_rad", "shear_modulus_m"):
        size = float(after[f"{key}_std"])
        assert size > 1.05 * float(before[f"{key}_std"])
        assert abs(float(after[key]) - float(before[key])) < size
