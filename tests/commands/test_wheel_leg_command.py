"""`soilml wheel-leg`: from strides to the soil by each sensor, and fused."""

import csv
import io

import numpy as np
import pytest

from soilml.cli import main
from soilml.systems.wheel_legs import PRINTED_SINKAGE, TORQUE_SLIP

HEAD = "run,slip,torque_Nm,vibration_m_s2,sinkage_m\n"


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def strides(tmp_path):
    """Two soils; the torque of the first is that of the printed model at 40 degrees."""
    angle, stiffness = np.deg2rad(40.0), 11300.0
    a, b = TORQUE_SLIP["empirical"].line(angle, stiffness)
    lines = [f"a,{slip},{(slip - a) / b},,0.01\n" for slip in (0.1, 0.3, 0.5)]
    file = tmp_path / "strides.csv"
    file.write_text(HEAD + "".join(lines) + "b,0.2,,,0.02\n")
    return file


def test_each_sensor_and_the_fused_soil(strides, capsys):
    assert main(["wheel-leg", str(strides), "--by", "run", "--torque-model", "empirical"]) == 0
    found = {(row["run"], row["sensor"]): row for row in rows_of(capsys.readouterr().out)}
    assert set(found) == {("a", "torque"), ("a", "sinkage"), ("a", "fused"), ("b", "sinkage")}
    torque, sinkage, fused = (found["a", name] for name in ("torque", "sinkage", "fused"))
    assert float(torque["friction_angle_rad"]) == pytest.approx(np.deg2rad(40.0), abs=1e-6)
    assert float(torque["normal_stiffness_Pa"]) == pytest.approx(11300.0, rel=1e-6)
    expected = PRINTED_SINKAGE(0.01)
    assert float(sinkage["friction_angle_rad"]) == pytest.approx(float(expected.friction_angle))
    t, s = (float(row["friction_angle_rad_std"]) ** 2 for row in (torque, sinkage))
    weight = s / (s + t)  # eq. 26
    mean = [float(row["friction_angle_rad"]) for row in (torque, sinkage)]
    assert float(fused["friction_angle_rad"]) == pytest.approx(
        weight * mean[0] + (1.0 - weight) * mean[1]
    )


def test_a_sensor_that_tells_nothing_is_named_and_the_others_answer(tmp_path, capsys):
    file = tmp_path / "strides.csv"
    file.write_text(HEAD + "a,0.2,1.1,,0.05\n")
    assert main(["wheel-leg", str(file), "--torque-model", "empirical"]) == 0
    said = capsys.readouterr()
    assert [row["sensor"] for row in rows_of(said.out)] == ["sinkage"]
    assert "no estimate from torque: 1 pair is given" in said.err
    assert "outside of the 2 to 36 mm" in said.err


@pytest.mark.parametrize(
    ("text", "options", "expected"),
    [
        ("run,slip,torque_Nm\na,0.2,1.1\n", ["--torque-model", "x"], "no slip model 'x'"),
        ("run,slip\na,0.2\n", [], "nothing was measured"),
        ("run,slip,torque_Nm\na,0.2,\n", [], "nothing was measured"),
        ("run,slip,sinkage_m\na,0.2,-0.01\n", [], "a midstance sinkage must be above 0 m"),
        ("run,slip,torque_Nm\na,0.2,1.1\n", ["--torque-std", "-1"], "torque_std is -1"),
    ],
)
def test_bad_strides_are_refused_in_one_line(text, options, expected, tmp_path, capsys):
    file = tmp_path / "strides.csv"
    file.write_text(text)
    out = tmp_path / "soil.csv"
    assert main(["wheel-leg", str(file), *options, "--out", str(out)]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert expected in said[-1]
    assert not out.exists()
