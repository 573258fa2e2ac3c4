"""Guesses for rigs whose vertical axis is another one than z."""

import numpy as np
import pytest
from foreign_rigs import drive, noisy, table

from soilml.log_import import init_map
from soilml.optional_imports import tomllib

#: Axis -> roles of its force, its moment and its place: (travel, vertical, across).
RIGS = [("x", "y", "z"), ("x", "z", "y"), ("z", "y", "x"), ("y", "x", "z")]


def rig(folder, axes, sign=1.0):
    """Logs of forces and places along axes, the torque about the one across."""
    rng = np.random.default_rng(1)
    d = drive(rng, (0.1, 0.2, 0.4, 0.6), [50, 60, 60, 70])
    travel, up, across = axes
    zero = np.zeros(d.t.size)
    columns = {"t": d.t, "omega": d.omega}
    columns[f"pos {travel}"] = np.cumsum(d.v) / 25
    columns[f"pos {up}"] = -d.sinkage
    columns[f"pos {across}"] = noisy(rng, zero, 0.0004)
    columns |= {f"F{travel}": d.pull, f"F{up}": sign * d.load, f"F{across}": noisy(rng, zero, 0.5)}
    columns |= {f"M{across}": d.torque, f"M{travel}": noisy(rng, zero, 0.05)}
    names = sorted(columns, key=lambda name: ("tom".find(name[0]), name))
    file = folder / "log.csv"
    file.write_text("\n".join([",".join(names), *table([columns[n] for n in names])]))
    return file


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axes", RIGS)
def test_the_largest_steady_force_is_the_load_whatever_its_axis(tmp_path, axes, sign):
    travel, up, across = axes
    text = init_map(rig(tmp_path, axes, sign))
    found = tomllib.loads(text)
    assert found["load"]["column"] == f"F{up}"
    assert found["load"].get("reverse", False) == (sign < 0)
    assert found["drawbar_pull"]["column"] == f"F{travel}"
    assert found["torque"]["column"] == f"M{across}"


@pytest.mark.parametrize("axes", RIGS)
def test_the_place_along_the_axis_of_the_load_is_the_sinkage(tmp_path, axes):
    travel, up, _ = axes
    text = init_map(rig(tmp_path, axes))
    found = tomllib.loads(text)
    assert found["sinkage"]["column"] == f"pos {up}"
    assert f'column = "pos {up}"  # CHANGE: a place along {up}, the axis of the load' in text
    place = found["position"]["column"]
    assert f"pos {travel}" in place and f"pos {up}" not in place


def test_a_named_sinkage_stays_beside_a_place(tmp_path):
    file = rig(tmp_path, RIGS[0])
    head, *rows = file.read_text().splitlines()
    where = head.split(",").index("pos y")
    depths = [f"{row},{-1e3 * float(row.split(',')[where]):.4f}" for row in rows]
    file.write_text("\n".join([f"{head},sinkage [mm]", *depths]))
    assert tomllib.loads(init_map(file))["sinkage"]["column"] == "sinkage"


def test_what_one_wheel_shows_holds_for_the_others(tmp_path):
    rng = np.random.default_rng(2)
    d = drive(rng, (0.1, 0.2, 0.4, 0.6), [50, 60, 60, 70])
    zero = np.zeros(d.t.size)
    columns = {"t": d.t, "omega": d.omega, "v": d.v}
    for wheel in ("fl", "fr"):
        columns |= {f"{wheel}_fx": noisy(rng, d.pull, 0.1), f"{wheel}_fy": noisy(rng, d.load, 0.1)}
        columns |= {f"{wheel}_fz": noisy(rng, zero, 0.5), f"{wheel}_mz": noisy(rng, d.torque, 0.01)}
        columns[f"{wheel}_mx"] = noisy(rng, zero, 0.02)
    (tmp_path / "log.csv").write_text("\n".join([",".join(columns), *table(columns.values())]))
    wheels = tomllib.loads(init_map(tmp_path / "log.csv"))["wheels"]
    for name, short in (("front_left", "fl"), ("front_right", "fr")):
        own = {role: channel["column"] for role, channel in wheels[name].items() if role != "axle"}
        assert own == {
            "load": f"{short}_fy",
            "drawbar_pull": f"{short}_fx",
            "torque": f"{short}_mz",
        }
