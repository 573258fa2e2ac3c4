"""Channels and constants that a new map has right, over logs of rigs written after descriptions."""

import json

import numpy as np
import pytest
from foreign_rigs import drive, table
from guessed_channels import is_marked

from soilml.log_import import import_log, init_map
from soilml.log_import.readers import read_log
from soilml.log_import.readers.side_files import side_lines


@pytest.mark.parametrize("kind", ["json", "csv", "txt", "own"])
def test_files_beside_a_log_state_constants(kind, tmp_path):
    d = drive(np.random.default_rng(3), (0.1, 0.4), [60] * 2)
    log = tmp_path / "log1.csv"
    rows = table((d.t, d.omega, d.v, d.torque, d.load))
    log.write_text("\n".join(["t,omega,v,torque,Fz", *rows]))
    content = {"wheel_radius_mm": 130, "gear_ratio": 1}
    if kind == "json":
        (tmp_path / "run_parameters.json").write_text(json.dumps(content, indent=2))
    elif kind == "csv":
        (tmp_path / "RUN_PARAMETERS.csv").write_text("wheel_radius_mm,gear_ratio\n130,1\n")
    else:
        name = "RUN_PARAMETERS" if kind == "txt" else "log1_meta"
        (tmp_path / f"{name}.txt").write_text("wheel_radius_mm = 130\n")
    (tmp_path / "log2_meta.txt").write_text("wheel_radius_mm = 999\n")  # of another log
    (tmp_path / "notes.txt").write_text("radius: 888 mm\n")
    assert not any("999" in line or "888" in line for line in side_lines(log))
    text = init_map(sorted(tmp_path.glob("*.csv")))  # the table of parameters is no log
    assert 'radius = "130' in text
    (tmp_path / "map.toml").write_text(text)
    found = import_log(log, tmp_path / "map.toml")
    assert found.radius == pytest.approx(0.13)


def test_guesses_without_support_are_marked(tmp_path):
    """A pull above the load, a moment as a depth, and a name that says nothing."""
    d = drive(np.random.default_rng(3), (0.1, 0.4), [60] * 2)
    log = tmp_path / "log.csv"
    rows = table((d.t, d.omega, d.v, d.torque, 0.2 * d.load, 3 * d.pull, d.load))
    log.write_text("\n".join(["t,omega,v,torque [Nm],normal force [N],drawbar pull [N],gauge [mm]",
                              *rows]))  # fmt: skip
    text = init_map(log)
    assert "CHANGE: drawbar pull is" in text
    assert is_marked(text, ("load",)) and is_marked(text, ("drawbar_pull",))
    assert '# [sinkage]  # CHANGE: perhaps one of "gauge"' in text


def test_a_separator_in_the_brackets_of_a_header(tmp_path):
    d = drive(np.random.default_rng(3), (0.1, 0.4), [60] * 2)
    rows = table((d.t, 9 * d.omega, d.v, d.torque, d.load))
    header = "t (s),motor speed (rad/s, before gearbox),v (m/s),torque (Nm),Fz (N)"
    (tmp_path / "log.csv").write_text("\n".join([header, *rows]))
    (recording,) = read_log(tmp_path / "log.csv")
    assert [*recording.columns] == ["t", "motor speed before gearbox", "v", "torque", "Fz"]
    assert recording.units["motor speed before gearbox"] == "rad/s"
