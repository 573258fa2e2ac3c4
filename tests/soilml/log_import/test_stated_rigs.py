"""What stands in names, heads and comments of a log takes part, and so does what it leaves out."""

import json

import numpy as np
import pytest
from foreign_rigs import drive, law, nearest_stage, table
from stated_rigs import WRITERS, a_lever

from soilml.log_import import import_log, init_map
from soilml.log_import.channels.wheel_quantities import slope_of
from soilml.log_import.readers import read_log
from soilml.log_import.readers.missing_codes import without_codes
from soilml.log_import.readers.text_layout import name_and_unit
from soilml.log_import.recording import Recording
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


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("Zeit / s", ("Zeit", "s")),
        ("Drehmoment / (N·m)", ("Drehmoment", "N·m")),
        ("Kraft in N", ("Kraft", "N")),
        ("stuck in sand", ("stuck in sand", "")),
        ("Fz [N]", ("Fz", "N")),
        ("m/s", ("m/s", "")),
        ("left / right", ("left / right", "")),
    ],
)
def test_name_and_unit_of_a_header(cell, expected):
    assert name_and_unit(cell) == expected


def test_slope_of_accelerations_and_of_a_quaternion_agree():
    """A turn by yaw, then by pitch, then by roll; gravity in the axes of the vehicle."""
    yaw, up, roll = 0.7, 0.2, -0.1
    a, b, c = (np.asarray([np.cos(v / 2), np.sin(v / 2)]) for v in (yaw, -up, roll))

    def product(p, q):
        w = p[0] * q[0] - p[1:] @ q[1:]
        return np.append(w, p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))

    turn = product(
        product([a[0], 0, 0, a[1]] * np.ones(4), np.asarray([b[0], 0, b[1], 0])),
        np.asarray([c[0], c[1], 0, 0]),
    )
    w, x, y, z = (3.0 * part * np.ones(1) for part in turn)  # of any length
    assert slope_of([x, y, z, w])[0] == pytest.approx(up)
    gravity = (np.sin(up), np.sin(roll) * np.cos(up), np.cos(roll) * np.cos(up))
    assert slope_of([9.8 * part * np.ones(1) for part in gravity])[0] == pytest.approx(up)
    assert slope_of([np.asarray([0.3])])[0] == 0.3


@pytest.mark.parametrize(
    ("values", "left"),
    [
        ([1.0, 2.0, -9999.0, 1.5, -9999.0], 3),
        ([1.0, 2.0, -9999.0, 1.5, 1.2], 5),  # once: an outlier, and not a code
        ([990.0, 995.0, 999.0, 999.0, 993.0], 5),  # a reading like its neighbours
        ([0.1, 0.2, 65535.0, 65535.0, 0.15], 3),
        ([5.0, 6.0, 1000.0, 1000.0, 5.5], 5),  # no code
        ([9999.0, 9999.0, 9999.0], 3),
        ([1.0, 1e308, -1e30, 1.2, 9.9e29], 3),
    ],
)
def test_codes_of_missing_readings(values, left, tmp_path):
    found = without_codes(Recording("", tmp_path, {"a": np.asarray(values)}))
    assert int(np.isfinite(found.columns["a"]).sum()) == left
    assert bool(found.notes) == (left < len(values))


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
