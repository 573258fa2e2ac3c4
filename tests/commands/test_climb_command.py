"""`soilml climb`: from a rover's files to the slope that it can climb."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from console import refused, rows_of

from soilml.cli import main
from soilml.io.text_tables import csv_text
from soilml.systems.rim_stress import SimulatedRover

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
COMMAND = ["paper", "climb", "rover.toml", "runs.csv", "--stress", "stress.csv"]


@pytest.fixture(scope="module")
def true():
    return SimulatedRover()


@pytest.fixture(scope="module")
def tables(true):
    rng = np.random.default_rng(6)
    climbs = true.simulate_climbs(rng, np.deg2rad([0.0, 4.0, 8.0]).tolist(), 2)
    path = Path(__file__).parents[2] / "examples" / "make.py"
    spec = importlib.util.spec_from_file_location("make_examples", path)
    spec.loader.exec_module(make := importlib.util.module_from_spec(spec))
    return make.climb_tables(
        climbs, *true.simulate_artificial_slip(rng, repeats=2), rim_speed=0.00915
    )


@pytest.fixture
def folder(workplace, tables):
    (workplace / "rover.toml").write_text(ROVER)
    (workplace / "runs.csv").write_text(csv_text(tables[0]))
    (workplace / "stress.csv").write_text(csv_text(tables[1]))
    return workplace


@pytest.mark.slow
def test_the_interval_contains_the_steepest_slope(folder, true, capsys):
    assert main([*COMMAND, "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    low, high = (found[f"steepest_slope_rad_{end}"] for end in ("p05", "p95"))
    assert low - 0.01 < true.steepest < high + 0.01
    modulus = found["soil"]["parameters"]["shear_modulus"]
    assert abs(modulus["value"] - true.shear[2]) < 3.5 * modulus["std"]
    assert len(found["climbs"]["run"]) == 6


@pytest.mark.slow
def test_page_and_table_have_pull_and_slope_over_slip(folder, capsys):
    assert main([*COMMAND, "--report", "found", "--out", "curve.csv"]) == 0
    message = capsys.readouterr().out
    assert message.startswith("The rover climbs ") and "Stress on slopes" in message
    content = json.loads((folder / "found" / "report.json").read_text())
    page = (folder / "found" / "report.html").read_text()
    best = np.rad2deg(content["steepest_slope_rad"])
    assert f"{best:.2f}" in page and "6 climbs on 3 slopes" in page and "<svg" in page
    assert content["report"]["kind"] == "climb" and len(content["report"]["files"]) == 3
    for row in rows_of((folder / "curve.csv").read_text()):
        low, middle, high = (float(row[f"slope_rad{end}"]) for end in ("_p05", "", "_p95"))
        assert low <= middle <= high


@pytest.mark.slow
def test_stress_in_kpa_is_told(folder, tables, capsys):
    """The force balance is the same: only M, the true over the measured stress, shows it."""
    stress = {**tables[1], "normal_Pa": [v / 1000.0 for v in tables[1]["normal_Pa"]]}
    (folder / "stress.csv").write_text(csv_text(stress))
    assert main(COMMAND) == 0
    assert "probably normal_Pa is in kPa" in " ".join(capsys.readouterr().out.split())


def changed(table, name, change):
    return {**table, name: [change(v) for v in table[name]]}


def without(table, name):
    return {n: v for n, v in table.items() if n != name}


def of_run(table, name, run, value):
    cells = zip(table["run"], table[name], strict=True)
    return {**table, name: [value if r == run else v for r, v in cells]}


def without_wheel(table, run):
    """The table without the rear wheel of a run."""
    keys = zip(table["run"], table["wheel"], strict=True)
    kept = [i for i, key in enumerate(keys) if key != (run, "rear")]
    return {name: [values[i] for i in kept] for name, values in table.items()}


FAULTS = {
    "slope in degrees": (
        lambda r, s: (changed(r, "slope_rad", np.rad2deg), s),
        "runs.csv line 6, column slope_rad",
    ),
    "angles the wrong way": (
        lambda r, s: (r, changed(s, "angle_rad", lambda v: -v)),
        "angle_rad (positive forward)",
    ),
    "blank speed": (
        lambda r, s: (of_run(r, "speed_m_s", "4deg_1", np.nan), s),
        "runs.csv line 6, column speed_m_s: the cell is blank",
    ),
    "stress of a wheel without slip": (
        lambda r, s: ({n: v[:-1] for n, v in r.items()}, s),
        "flat_rear_8, rear: no slip; needed is a row of this wheel in runs.csv",
    ),
    "no slip": (lambda r, s: (without(r, "speed_m_s"), s), "column slip is missing"),
    "one wheel": (
        lambda r, s: (without_wheel(r, "8deg_2"), without_wheel(s, "8deg_2")),
        "run 8deg_2 has no row for its rear wheel",
    ),
    "a slope beyond grip": (
        lambda r, s: (of_run(r, "slope_rad", "8deg_1", 1.2), s),
        "no single soil within the ranges explains these climbs",
    ),
    "climbs that contradict": (
        lambda r, s: (of_run(r, "slope_rad", "8deg_1", 0.5), s),
        "no single soil within the ranges explains these climbs",
    ),
    "two slopes of one run": (
        lambda r, s: ({**r, "slope_rad": [0.01 * i for i in range(len(r["run"]))]}, s),
        "needed is one slope per run",
    ),
    "unit in kPa": (
        lambda r, s: (r, {("normal_kPa" if n == "normal_Pa" else n): v for n, v in s.items()}),
        "name the column normal_Pa",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_invalid_tables_are_refused_in_one_line(folder, tables, capsys, fault):
    change, message = FAULTS[fault]
    runs, stress = change(*tables)
    (folder / "runs.csv").write_text(csv_text(runs))
    (folder / "stress.csv").write_text(csv_text(stress))
    refused([*COMMAND, "--report", "found"], capsys, message, folder)


ROVER_FAULTS = {
    "degrees": (ROVER.replace("0.6632", "38"), "if 38 are degrees, write 0.6632"),
    "half a centre of mass": (ROVER.replace("height_ratio = 0.4", ""), "height_ratio"),
    "number and range": (
        ROVER.replace("[soil.prior]", "[soil.prior]\ncohesion = [0.0, 9.0]"),
        "remove one of them",
    ),
    "speed without share": (ROVER.replace('"0.87 %"', "0.001"), "must be a percentage"),
}


@pytest.mark.parametrize("fault", ROVER_FAULTS)
def test_invalid_rover_files_are_refused_in_one_line(folder, capsys, fault):
    text, message = ROVER_FAULTS[fault]
    (folder / "rover.toml").write_text(text)
    refused([*COMMAND, "--report", "found"], capsys, message, folder)
