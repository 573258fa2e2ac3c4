"""A tracked robot from the shell: how it stands in the soil, and its soil from the log of pulls."""

from pathlib import Path

import numpy as np
import pytest
from console import rows_printed

from soilml.cli import main

MODEL = """\
[gear]
type = "track"
radius = 0.1
width = 0.08
base = 0.6
[soil]
name = "wang2018/sand"
[soil.prior]
friction_angle = [0.349, 0.698]
shear_modulus = [0.01, 0.08]
[noise]
drawbar_pull_N = "3 % + 5"
"""
WORDS = ("status", "traffic_class")  # columns of words
SIMULATE = ["simulate", "m.toml", "--slip", "0.02,0.1,0.3", "--load", "638"]


@pytest.fixture
def folder(workplace):
    (workplace / "m.toml").write_text(MODEL)
    return workplace


def test_the_tractive_efficiency_of_a_track(folder, capsys):
    rows = rows_printed([*SIMULATE, "--efficiency", "--picture", "t.png"], capsys)
    cells = {name: [row[name] for row in rows] for name in rows[0] if name not in WORDS}
    level = {name: np.asarray(own, float) for name, own in cells.items()}
    ratio = (1.0 - level["slip"]) * 0.1 * level["drawbar_pull_N"] / level["torque_Nm"]
    np.testing.assert_allclose(level["tractive_efficiency"], ratio)
    assert (folder / "t.png").read_bytes().startswith(b"\x89PNG")


def test_the_log_of_the_example_gives_the_soil_that_was_put_in(workplace, capsys):
    """Friction angle 25 degrees, shear modulus 45.1 mm; lasers that read to a millimetre."""
    assert main(["example", "track", ".", "--quiet"]) == 0
    command = ["paper", "track", "model.toml", "log.csv", "--mass", "130", "--spacing", "0.6"]
    rows = rows_printed([*command, "--picture", "t.png", "--report", "page"], capsys)
    assert len(rows) == 7
    for row in rows:
        read, said = (float(row[name]) for name in ("drawbar_pull_N", "pull_predicted_N"))
        assert said == pytest.approx(read, abs=4.0 * float(row["drawbar_pull_N_std"]))
        sunk, deep = (float(row[f"rear_sinkage{end}_m"]) for end in ("", "_predicted"))
        assert sunk == pytest.approx(deep, abs=2e-4)
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")
    page = Path("page/report.html").read_text()
    assert "Line of the belt" in page
