"""A track in a model file: solved, generated, identified and refused like any gear."""

import csv
import json

import numpy as np
import pytest

from soilml.cli import main

MODEL = """\
[gear]
type = "track"
radius = 0.1
width = 0.08
base = 0.6
[soil]
name = "wang2018/clay"
[soil.prior]
friction_angle = [0.3, 0.8]
shear_modulus = { range = [0.005, 0.08], scale = "log" }
[noise]
torque_Nm = "1 %"
drawbar_pull_N = "1 % + 2"
[[effect]]
name = "shear-softening"
share = 1.0
peak = 1.0
"""


@pytest.fixture
def model(tmp_path):
    (tmp_path / "model.toml").write_text(MODEL)
    return tmp_path / "model.toml"


def test_what_is_simulated_is_identified_without_a_false_alarm(model, tmp_path, capsys):
    """The pull of clay falls behind its peak: no sign is turned."""
    curve, fit = str(tmp_path / "curve.csv"), tmp_path / "fit.json"
    runs = ["--slip", "0.05:0.9:6", "--load", "300:900:2", "--run", "a", "--out", curve]
    assert main(["simulate", str(model), *runs]) == 0
    assert main(["identify", str(model), curve, "--out", str(fit)]) == 0
    found = json.loads(fit.read_text())["parameters"]
    assert found["friction_angle"]["value"] == pytest.approx(0.541, rel=2e-3)
    assert found["shear_modulus"]["value"] == pytest.approx(0.0348, rel=0.05)
    assert "falls as slip grows" not in "".join(capsys.readouterr())


def test_a_load_that_the_soil_does_not_carry_is_a_blank_row_with_its_reason(model, tmp_path):
    curve = tmp_path / "curve.csv"
    runs = ["--slip", "0.2", "--load", "600,1e6", "--out", str(curve)]
    assert main(["simulate", str(model), *runs]) == 0
    light, heavy = csv.DictReader(curve.read_text().splitlines())
    assert light["status"] == "ok" and np.isfinite(float(light["drawbar_pull_N"]))
    assert "no equilibrium" in heavy["status"] and heavy["drawbar_pull_N"] == ""
