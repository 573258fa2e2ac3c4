"""`soilml climb`: from a rover's files to the slope that it can climb."""

import csv
import json

import numpy as np
import pytest

from soilml.cli import main
from soilml.config.measurement_noise import Noise
from soilml.io.text_tables import csv_text
from soilml.systems.climbing import SimulatedRover
from soilml.systems.climbing.tables import climb_tables, read_climb_data

ROVER = """\
[rover]
mass = 12.0
radius = 0.055
width = 0.064
front_share = 0.52
height_ratio = 0.4
[soil]
cohesion = 0.0
friction_angle = 0.6632
[soil.prior]
shear_modulus = [0.001, 0.05]
[noise]
speed_m_s = "0.87 %"
slope_rad = 0.005
"""
COMMAND = ["climb", "rover.toml", "runs.csv", "--stress", "stress.csv"]


@pytest.fixture(scope="module")
def true():
    return SimulatedRover()


@pytest.fixture(scope="module")
def tables(true):
    rng = np.random.default_rng(6)
    climbs = true.simulate_climbs(rng, np.deg2rad([0.0, 4.0, 8.0]).tolist(), 2)
    return climb_tables(climbs, *true.simulate_artificial_slip(rng, repeats=2), rim_speed=0.00915)


@pytest.fixture
def folder(tmp_path, tables, monkeypatch):
    (tmp_path / "rover.toml").write_text(ROVER)
    (tmp_path / "runs.csv").write_text(csv_text(tables[0]))
    (tmp_path / "stress.csv").write_text(csv_text(tables[1]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_empty_output_name_is_refused(folder, capsys):
    before = sorted(folder.iterdir())
    assert main([*COMMAND, "--out", ""]) == 2
    assert "--out is empty" in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before


@pytest.mark.slow
def test_the_interval_contains_the_steepest_slope(folder, true, capsys):
    assert main([*COMMAND, "--slip-limit", "0.3", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    best = found["steepest_slope_rad"]
    assert best["p05"] - 0.01 < true.steepest < best["p95"] + 0.01
    assert found["steepest_slope_within_slip_limit_rad"]["median"] < best["median"]
    modulus = found["ground"]["parameters"]["shear_modulus"]
    assert abs(modulus["value"] - true.shear[2]) < 3.5 * modulus["std"]
    assert found["ground"]["given"]["cohesion"] == 0.0
    assert len(found["runs"]) == 6


@pytest.mark.slow
def test_a_folder_receives_report_curve_and_climbs(folder, capsys):
    assert main([*COMMAND, "--out", "found"]) == 0
    message = capsys.readouterr().out
    assert "6 climbs on 3 slopes" in message and "steepest slope" in message
    content = json.loads((folder / "found" / "climb.json").read_text())
    page = (folder / "found" / "report.html").read_text()
    best = np.rad2deg(content["steepest_slope_rad"]["median"])
    assert f"The steepest slope is {best:.1f}°" in page and "<img" in page
    assert content["report"]["kind"] == "climb" and len(content["report"]["files"]) == 3
    assert sorted(f.name for f in (folder / "found").iterdir()) == [
        "climb.json", "climbs.csv", "curve.csv", "report.html",
    ]  # fmt: skip
    with (folder / "found" / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        low, middle, high = (float(row[f"slope_rad{end}"]) for end in ("_p05", "", "_p95"))
        assert low <= middle <= high


@pytest.mark.slow
def test_the_same_seed_gives_the_same_result(folder):
    for name in ("a.json", "b.json"):
        assert main([*COMMAND, "--seed", "3", "--out", name]) == 0
    assert (folder / "a.json").read_text() == (folder / "b.json").read_text()


def test_tables_are_read_back_as_written(folder, tables):
    data = read_climb_data("runs.csv", "stress.csv", Noise(share=0.05))
    again = climb_tables(data.climbs, rim_speed=0.00915)
    for name, values in tables[0].items():
        if isinstance(values[0], str):
            assert again[0][name] == values
        else:
            np.testing.assert_allclose(again[0][name], values, rtol=1e-8, atol=1e-12)
    assert len(data.front) == len(data.rear) == 6 + 8


def changed(table, name, change):
    return {**table, name: [change(v) for v in table[name]]}


def without(table, name):
    return {n: v for n, v in table.items() if n != name}


def only(table, keep):
    kept = [keep(run) for run in table["run"]]
    return {n: [v for v, k in zip(c, kept, strict=True) if k] for n, c in table.items()}


def of_run(table, name, run, value):
    cells = zip(table["run"], table[name], strict=True)
    return {**table, name: [value if r == run else v for r, v in cells]}


FAULTS = {
    "slope in degrees": (
        lambda r, s: (changed(r, "slope_rad", np.rad2deg), s),
        "runs.csv line 6, column slope_rad",
    ),
    "angles in degrees": (
        lambda r, s: (r, changed(s, "angle_rad", np.rad2deg)),
        "stress.csv line 2, column angle_rad",
    ),
    "angles the wrong way": (
        lambda r, s: (r, changed(s, "angle_rad", lambda v: -v)),
        "angle_rad (positive forward)",
    ),
    "blank speed": (
        lambda r, s: (of_run(r, "speed_m_s", "4deg_1", np.nan), s),
        "runs.csv line 6, column speed_m_s: the cell is blank",
    ),
    "NaN": (
        lambda r, s: (of_run(r, "slope_rad", "4deg_1", "NaN"), s),
        "runs.csv line 6, column slope_rad: 'NaN' is not a number",
    ),
    "no slip": (lambda r, s: (without(r, "speed_m_s"), s), "column slip is missing"),
    "no stress": (lambda r, s: (r, without(s, "normal_Pa")), "column normal_Pa is missing"),
    "no contact": (
        lambda r, s: (r, of_run(s, "normal_Pa", "8deg_2", 0.0)),
        "run 8deg_2, front: a stress profile without contact",
    ),
    "one wheel": (
        lambda r, s: ({n: v[:-1] for n, v in r.items()}, s),
        "run 8deg_2 has no row for its rear wheel",
    ),
    "another wheel": (
        lambda r, s: (changed(r, "wheel", lambda v: "left" if v == "front" else v), s),
        "'left' given; needed is front or rear",
    ),
    "a run twice": (
        lambda r, s: ({n: [*v, v[0]] for n, v in r.items()}, s),
        "run 0deg_1 has a second row for its front wheel",
    ),
    "a climb without stress": (
        lambda r, s: (r, only(s, lambda run: run != "4deg_2")),
        "no stress of the front wheel in run 4deg_2",
    ),
    "a slope beyond grip": (
        lambda r, s: (of_run(r, "slope_rad", "8deg_1", 1.2), s),
        "run 8deg_1: a slope of 1.2 rad requires",
    ),
    "climbs that contradict": (
        lambda r, s: (of_run(r, "slope_rad", "8deg_1", 0.5), s),
        "no single soil within the ranges explains these climbs",
    ),
    "stress at one slip": (
        lambda r, s: (only(r, lambda run: run[0] == "0"), only(s, lambda run: run[0] == "0")),
        "needed are two slips",
    ),
    "two slips of one run": (
        lambda r, s: (r, changed(s, "slip", lambda v: v + 0.1)),
        "here and",
    ),
    "two slopes of one run": (
        lambda r, s: ({**r, "slope_rad": [0.01 * i for i in range(12)]}, s),
        "needed is one slope per run",
    ),
    "unit in kPa": (
        lambda r, s: (r, {("normal_kPa" if n == "normal_Pa" else n): v for n, v in s.items()}),
        "name the column normal_Pa",
    ),
    "a std that is not read": (
        lambda r, s: ({**r, "slope_rad_std": [0.01] * 12}, s),
        "set it in [noise]",
    ),
}


def refused(folder, capsys, message, command=COMMAND):
    before = sorted(p.name for p in folder.rglob("*"))
    assert main([*command, "--out", "found"]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and message in captured.err, captured.err
    assert captured.out == ""
    assert sorted(p.name for p in folder.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_invalid_tables_are_refused_in_one_line(folder, tables, capsys, fault):
    change, message = FAULTS[fault]
    runs, stress = change(*tables)
    (folder / "runs.csv").write_text(csv_text(runs))
    (folder / "stress.csv").write_text(csv_text(stress))
    refused(folder, capsys, message)


ROVER_FAULTS = {
    "misspelt": (ROVER.replace("radius", "raduis"), "radius is missing"),
    "degrees": (ROVER.replace("0.6632", "38"), "if 38 are degrees, write 0.6632"),
    "half a centre of mass": (ROVER.replace("height_ratio = 0.4", ""), "belong together"),
    "no weight": (ROVER.replace("12.0", "0"), "mass is 0 kg"),
    "number and range": (
        ROVER.replace("[soil.prior]", "[soil.prior]\ncohesion = [0.0, 9.0]"),
        "remove one of them",
    ),
    "range the wrong way": (ROVER.replace("[0.001, 0.05]", "[0.05, 0.001]"), "lower below upper"),
    "unknown noise": (ROVER.replace("slope_rad", "slope_deg"), "did you mean 'slope_rad'?"),
    "noise below zero": (ROVER.replace("0.005", "-0.005"), "in [0, 1)"),
    "speed without share": (ROVER.replace('"0.87 %"', "0.001"), "must be a percentage"),
}


@pytest.mark.parametrize("fault", ROVER_FAULTS)
def test_invalid_rover_files_are_refused_in_one_line(folder, capsys, fault):
    text, message = ROVER_FAULTS[fault]
    (folder / "rover.toml").write_text(text)
    refused(folder, capsys, message)


def test_too_few_slopes_are_refused_with_the_number_needed(folder, tables, capsys):
    (folder / "rover.toml").write_text(ROVER.split("[soil]")[0])
    (folder / "runs.csv").write_text(csv_text(only(tables[0], lambda run: run[0] == "0")))
    refused(folder, capsys, "one slope for 3 parameters")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--slip-limit", "30"], "needed is a slip between 0 and 1"),
        (["--seed", "-1"], "needed is a whole number"),
    ],
)
def test_invalid_options_are_errors_of_usage(folder, capsys, options, message):
    assert main([*COMMAND, *options]) == 2
    assert message in capsys.readouterr().err


def test_a_slip_limit_beyond_the_curve_is_refused_in_one_line(folder, capsys):
    options = ["--slip-limit", "0.95"]
    refused(folder, capsys, "there is no prediction outside", [*COMMAND, *options])


def test_a_table_is_not_overwritten(folder, capsys):
    assert main([*COMMAND, "--out", "runs.csv"]) == 2
    assert "is a file; needed is a folder" in capsys.readouterr().err
