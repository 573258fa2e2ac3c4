"""`soilml pull` of a whole rover: text, files, options that belong together."""

import pytest
from console import refused, rows_of

from soilml.cli import main

ROVER = """
[rover]
mass = 28
centre_of_mass = [0.0, 0.0, 0.3]
[rover.wheels]
front-left = { position = [0.4, 0.3] }
front-right = { position = [0.4, -0.3] }
rear-left = { position = [-0.4, 0.3] }
rear-right = { position = [-0.4, -0.3] }
"""
RUNS = "run,slip,load_N,torque_Nm\na,0.1,40,1.513\na,0.2,80,4.826\nb,0.3,40,2.777\n"


@pytest.fixture
def files(model_file, tmp_path):
    model_file.write_text(model_file.read_text() + ROVER)
    runs = tmp_path / "runs.csv"
    runs.write_text(RUNS)
    return [str(model_file), str(runs)]


@pytest.mark.slow
def test_a_rover_is_answered_for_as_a_whole(files, tmp_path, capsys):
    out, picture = tmp_path / "rover.csv", tmp_path / "rover.png"
    outputs = ["--out", str(out), "--picture", str(picture)]
    assert main(["pull", *files, "--slope", "0,8", "--gravity", "moon", *outputs, "-v"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("The rover climbs ") and "rear-left" in said
    rows = rows_of(out.read_text())
    assert [round(float(row["slope_rad"]), 3) for row in rows] == [0.0, 0.14]
    assert float(rows[1]["slip"]) > float(rows[0]["slip"])
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_slope_that_no_rover_stands_on_is_refused(files, capsys):
    words = ["pull", *files, "--slope", "58"]
    refused(words, capsys, "leaves the ground on a slope of 58 deg")
