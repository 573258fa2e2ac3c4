"""What stands in names, heads and comments of a log takes part, and so does what it leaves out."""

import json

import numpy as np
import pytest
from foreign_rigs import drive, law, nearest_stage, table
from stated_rigs import WRITERS, a_lever

from soilml.log_import import import_log, init_map
from soilml.log_import.readers import read_log
from soilml.remarks import about, texts


@pytest.mark.slow
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.__name__)
def test_a_guessed_map_with_few_edits_gives_the_truth(writer, tmp_path):
    logs, edits, stages = writer(np.random.default_rng(7), tmp_path)
    text = init_map(logs)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    rows = import_log(logs, tmp_path / "map.toml").table
    met = set()
    for i in range(len(rows)):
        slip, load = nearest_stage(stages, rows["slip"][i], rows["load_N"][i])
        met.add((slip, load))
        torque, pull, sinkage = law(slip, load)
        assert rows["slip"][i] == pytest.approx(slip, abs=0.012)
        assert rows["load_N"][i] == pytest.approx(load, rel=0.03)
        assert rows["torque_Nm"][i] == pytest.approx(torque, rel=0.05)
        if "drawbar_pull_N" in rows:
            assert rows["drawbar_pull_N"][i] == pytest.approx(pull, abs=0.8)
        if "sinkage_m" in rows:
            assert rows["sinkage_m"][i] == pytest.approx(sinkage, abs=2e-4)
    assert met == set(stages)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("column", ["t", "M"])
def test_huge_numbers_are_missing_in_every_format(tmp_path, column):
    """Differences and sums of them overflow, in readers as in guesses."""
    rows = [{"t": i, "v": 0.1, "w": 1.0, "M": 2 + i % 3} for i in range(40)]
    rows = [row | {column: (-1) ** i * 10**308} for i, row in enumerate(rows)]
    lines = [",".join(map(str, row.values())) for row in rows]
    (tmp_path / "a.csv").write_text("\n".join([",".join(rows[0]), *lines]))
    (csv,) = read_log(tmp_path / "a.csv")
    assert np.isnan(csv.columns[column]).all()
    assert texts(csv.notes) == [f"{column}: 40 numbers of 1e+30 or more are no readings"]
    assert csv.notes[0].text in init_map(tmp_path / "a.csv")
    (tmp_path / "a.json").write_text(json.dumps([row | {column: 10**400} for row in rows]))
    assert column not in read_log(tmp_path / "a.json")[0].columns


def test_a_map_without_torque_is_remarked_on(tmp_path):
    logs, edits, _ = a_lever(np.random.default_rng(7), tmp_path)
    text = init_map(logs).replace(*edits[0])
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    found = import_log(logs, tmp_path / "map.toml")
    assert about(found.remarks, "no-torque") == {"torque"}
    for old, new in edits[1:]:
        text = text.replace(old, new)
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    found = import_log(logs, tmp_path / "map.toml")
    assert not about(found.remarks, "no-torque")


def test_the_zero_of_a_height_is_asked_for(tmp_path):
    d = drive(np.random.default_rng(7), (0.1, 0.3), [50] * 2)
    header = "t (s),omega (rad/s),v (m/s),torque (Nm),Fz (N),{} (mm)"
    for name, asked in (("wheel_height", True), ("sinkage", False)):
        rows = table((d.t, d.omega, d.v, d.torque, d.load, 3 - 1000 * d.sinkage))
        (tmp_path / "log.csv").write_text("\n".join([header.format(name), *rows]))
        text = init_map([tmp_path / "log.csv"])
        assert ("CHANGE: a height is a sinkage where its zero" in text) == asked


def test_degrees_on_the_globe_are_named_as_no_place(tmp_path):
    d = drive(np.random.default_rng(7), (0.1, 0.3), [50] * 2)
    columns = (d.t, d.omega, d.torque, d.load, 48 + d.t / 1e6, 11 + 0 * d.t)
    header = "t (s),omega (rad/s),torque (Nm),Fz (N),latitude,longitude"
    (tmp_path / "log.csv").write_text("\n".join([header, *table(columns, digits=8)]))
    text = init_map([tmp_path / "log.csv"])
    assert "# latitude: degrees on the globe are no place; add columns in m" in text
    assert "# NEEDED: no column is the travel" in text
