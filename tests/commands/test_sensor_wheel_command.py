"""`soilml sensor-wheel`: the shear modulus that was put into stresses, and the pull by it."""

import math

import numpy as np
import pytest
from console import printed, refused, rows_of

from soilml import soil
from soilml.cli import main
from soilml.systems.rim_stress import SensingWheel, SteadyRun, balanced_arc

MODEL = """\
[gear]
type = "wheel"
radius = 0.055
width = 0.064
[soil]
name = "nagatani2009/toyoura_sand"
"""
SLOPES = {"flat": (0.11, 0.0), "up4": (0.29, math.radians(4.0)), "up6": (0.39, math.radians(6.0))}


@pytest.fixture
def files(workplace):
    """A wheel of k_x 7.2 mm on three slopes, its stress half of the true one."""
    sand = soil("nagatani2009/toyoura_sand")
    runs, stress = "run,slip,slip_std,load_N,slope_rad\n", "run,angle_rad,normal_Pa\n"
    for name, (slip, slope) in SLOPES.items():
        at = SteadyRun(slip=slip, weight=28.92, slope=slope)
        true = balanced_arc(math.radians(30.0), at, SensingWheel(), sand)
        runs += f"{name},{slip},0.01,28.92,{slope}\n"
        for angle, normal in zip(true.angle, 0.5 * true.normal, strict=True):
            stress += f"{name},{angle:.12g},{normal:.12g}\n"
    for name, text in (("m.toml", MODEL), ("runs.csv", runs), ("stress.csv", stress)):
        (workplace / name).write_text(text)
    return workplace


COMMAND = ["paper", "sensor-wheel", "m.toml", "runs.csv", "--stress", "stress.csv"]


def test_the_modulus_is_found_and_predicts_the_pull_of_the_slopes(files, capsys):
    said = printed([*COMMAND, "--format", "csv"], capsys)
    rows = rows_of(said.out)
    assert [row["run"] for row in rows] == list(SLOPES)
    for row in rows:
        assert float(row["shear_modulus_m"]) == pytest.approx(0.0072, rel=1e-3)
        assert float(row["magnification"]) == pytest.approx(2.0, rel=1e-3)
        required = 28.92 * np.sin(SLOPES[row["run"]][1])
        assert float(row["pull_on_slope_N"]) == pytest.approx(required, abs=1e-6)
        assert float(row["drawbar_pull_N"]) == pytest.approx(required, abs=0.01)
        assert 0.0 < float(row["shear_modulus_m_std"]) < 0.0072
    assert "--diameter removes that" in said.err


def test_a_stress_in_kpa_is_told(files, capsys):
    head, *rows = (line.split(",") for line in (files / "stress.csv").read_text().splitlines())
    lines = [",".join(head), *(f"{run},{angle},{float(p) / 1000}" for run, angle, p in rows)]
    (files / "stress.csv").write_text("\n".join(lines) + "\n")
    assert main(COMMAND) == 0
    assert "2e+03 times the measured one: probably normal_Pa is in kPa" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("file", "old", "new", "options", "expected"),
    [
        ("m.toml", '"wheel"', '"linear-wheel"', [], "needed is 'wheel'"),
        ("m.toml", "[soil]", '[[effect]]\nname = "exit-angle"\n[soil]', [], "remove [["),
        ("stress.csv", "up4,", "up5,", [], "run up4 has no stress"),
        ("runs.csv", "up4,", "flat,", [], "run flat has 2 rows"),
        ("runs.csv", "", "", ["--reference", "x"], "no run 'x'; there are: flat, up4, up6"),
        ("runs.csv", "slip,", "slide,", [], "slide"),
    ],
)
def test_bad_input_is_refused_in_one_line(files, file, old, new, options, expected, capsys):
    path = files / file
    path.write_text(path.read_text().replace(old, new) if old else path.read_text())
    refused([*COMMAND, *options, "--out", "out.csv"], capsys, expected, files)
