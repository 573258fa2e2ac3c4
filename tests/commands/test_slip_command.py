"""`soilml drive slip`: files, flags, and one line for bad input."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

from console import refused, rows_of
from slip_drives import simulate_drive

from soilml.cli import main
from soilml.io.text_tables import csv_text

ROVER = str(Path(__file__).parents[2] / "examples/slip/rover.toml")


@pytest.fixture
def drive(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = {"soils": 256, "change": 0.01}
    monkeypatch.setattr("soilml.slip_filter.drive.slip_of_drive.__kwdefaults__", few)
    found = simulate_drive(5, soils=1, rows=8, apart=0.1)
    Path("drive.csv").write_text(csv_text(found.columns()))
    return found


def test_table_json_and_picture_have_each_row(drive, capsys):
    words = ["drive", "slip", ROVER, "drive.csv"]
    assert main([*words, "--out", "slip.json"]) == 0
    assert main([*words, "--out", "slip.csv", "--picture", "slip.png"]) == 0
    assert "8 of 8 rows have a slip" in capsys.readouterr().out
    rows = rows_of(Path("slip.csv").read_text())
    assert len(rows) == 8
    for row in rows:
        low, middle, high = (float(row[f"slip_rear-left{end}"]) for end in ("_p05", "", "_p95"))
        assert low <= middle <= high
        assert 0.0 <= float(row["no_soil"]) <= 1.0
    content = json.loads(Path("slip.json").read_text())
    assert set(content) == {"columns", "remarks"}
    assert content["columns"]["flags"] == [row["flags"] for row in rows]
    assert Path("slip.png").read_bytes().startswith(b"\x89PNG")


def test_bad_input_is_one_line_and_writes_nothing(drive, capsys):
    text = Path("drive.csv").read_text()
    Path("drive.csv").write_text(text.replace("slope_rad", "slope_deg"))
    refused(["drive", "slip", ROVER, "drive.csv", "--out", "slip.csv"], capsys, "", Path())
    Path("drive.csv").write_text(text)
    Path("bad.toml").write_text(Path(ROVER).read_text().replace("pull_std", "pul_std"))
    refused(["drive", "slip", "bad.toml", "drive.csv"], capsys, "did you mean 'pull_std'")
