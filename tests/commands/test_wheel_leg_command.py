"""`soilml wheel-leg`: from strides to the soil by each sensor, and fused."""

import numpy as np
import pytest
from console import refused, rows_printed

from soilml.systems.wheel_legs.stride_relations import (
    TORQUE,
    VIBRATION,
    soil_of_sinkage,
)

HEAD = "run,slip,torque_Nm,vibration_m_s2,sinkage_m\n"


@pytest.fixture
def strides(tmp_path):
    """Two soils; the torque of the first is that of the printed model at 40 degrees."""
    a, b = TORQUE.line(np.deg2rad(40.0), 11300.0)
    lines = [f"a,{slip},{(slip - a) / b},,0.01\n" for slip in (0.1, 0.3, 0.5)]
    file = tmp_path / "strides.csv"
    file.write_text(HEAD + "".join(lines) + "b,0.2,,,0.02\n")
    return file


def test_each_sensor_and_the_fused_soil(strides, capsys):
    command = ["paper", "wheel-leg", str(strides), "--by", "run"]
    found = {(row["run"], row["sensor"]): row for row in rows_printed(command, capsys)}
    assert set(found) == {("a", "torque"), ("a", "sinkage"), ("a", "fused"), ("b", "sinkage")}
    torque, sinkage, fused = (found["a", name] for name in ("torque", "sinkage", "fused"))
    assert float(torque["friction_angle_rad"]) == pytest.approx(np.deg2rad(40.0), abs=1e-6)
    expected = soil_of_sinkage(0.01).mean[0]
    assert float(sinkage["friction_angle_rad"]) == pytest.approx(expected)
    weight = 9.0**2 / (9.0**2 + 14.0**2)  # eq. 30, with the scatter of table VIII
    mean = [float(row["friction_angle_rad"]) for row in (torque, sinkage)]
    assert float(fused["friction_angle_rad"]) == pytest.approx(
        weight * mean[0] + (1.0 - weight) * mean[1]
    )
    assert torque["pull_efficiency"] == "" and float(fused["kphi_SI"]) > 0.0
    assert fused["traffic_class"] in ("non-trafficable", "unsafe", "safe", "trafficable")
    assert float(fused["pull_efficiency_p05"]) < float(fused["pull_efficiency"])


def test_slip_on_a_known_soil_is_that_of_the_printed_lines(tmp_path, capsys):
    angle, stiffness = np.deg2rad(42.77), 13100.0 + 10500.0  # SSC-2 of table I
    a, b = TORQUE.line(angle, stiffness)
    c, d = VIBRATION.line(angle, stiffness)
    lines = [f"a,{s},{(s - a) / b},{(s - c) / d},\n" for s in (0.1, 0.3)]
    file, picture = tmp_path / "strides.csv", tmp_path / "slip.png"
    file.write_text(HEAD + "".join(lines) + f"b,,,{(0.4 - c) / d},\n")
    command = ["paper", "wheel-leg", str(file), "--known"]
    found = rows_printed([*command, "ssc-2", "--picture", picture], capsys)
    for row, slip in zip(found, (0.1, 0.3, 0.4), strict=True):
        for name in ("slip_by_torque", "slip_by_vibration", "slip"):
            assert row[name] == "" or float(row[name]) == pytest.approx(slip, abs=2e-4)
    assert found[2]["slip_by_torque"] == found[2]["slip_measured"] == ""
    assert float(found[0]["slip_std"]) == pytest.approx((1 / 0.018 + 1 / 0.020) ** -0.5)  # eq. 26
    assert float(found[2]["slip_std"]) == pytest.approx(0.020**0.5)
    assert picture.read_bytes().startswith(b"\x89PNG")
    again = rows_printed([*command, "42.77,23600"], capsys)
    assert float(again[1]["slip"]) == pytest.approx(float(found[1]["slip"]), abs=1e-3)


@pytest.mark.parametrize(
    ("text", "options", "expected"),
    [
        ("run,slip\na,0.2\n", [], "nothing was measured"),
        ("run,slip,torque_Nm\na,0.2,\n", [], "nothing was measured"),
        ("run,slip,sinkage_m\na,0.2,-0.01\n", [], "a midstance sinkage must be above 0 m"),
        ("run,slip,torque_Nm\na,0.2,1.1\n", ["--assume", "x=1"], "needed are n, cohesion"),
        ("run,torque_Nm\na,1.1\n", ["--known", "mud"], "needed is one of SSC-1, SSC-2"),
        ("run,torque_Nm\na,1.1\n", ["--known", "95,2e4"], "needed is one of SSC-1, SSC-2"),
        ("run,torque_Nm\na,1.1\n", ["--known", "es-3", "--by", "run"], "--by asks for a soil"),
        ("run,sinkage_m\na,0.01\n", ["--known", "es-3"], "give torque or vibration"),
    ],
)
def test_bad_strides_are_refused_in_one_line(text, options, expected, tmp_path, capsys):
    file = tmp_path / "strides.csv"
    file.write_text(text)
    words = ["paper", "wheel-leg", file, *options, "--out", tmp_path / "soil.csv"]
    refused(words, capsys, expected, tmp_path)
