"""The map that is written for a log nobody has described, and the traps of real logs."""

import json
import os
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from guessed_channels import printed
from simulated_rig import LOAD, RADIUS, RADIUS_EDIT, drive, imported, noisy, torque_law, write_csv

from soilml.cli import main
from soilml.errors import InputError
from soilml.io.read_table import read_table
from soilml.log_import import import_log, init_map
from soilml.log_import.guesses.map_guess import draft_map

SLIPS = (0.1, 0.3, 0.5)


def by_name(rng, d):
    return {"time_s": d.time, "wheel_rpm": noisy(rng, d.rim / RADIUS * 30 / np.pi, 0.01),
            "cart_speed_mm_s": noisy(rng, 1000 * d.ground, 0.5),
            "torque_Nm": noisy(rng, d.torque, 0.05), "vertical_load_N": noisy(rng, d.load, 1)}, (
        "\t", ".", "utf-8", (), None)  # fmt: skip


def by_unit_row(rng, d):
    columns = {"t": d.time, "w": np.degrees(d.rim / RADIUS), "v": noisy(rng, 100 * d.ground, 0.05),
               "T": d.torque, "F_z": d.load / 9.80665}  # fmt: skip
    return columns, (";", ",", "cp1252", ("Rig 2, 3.5.",), ("s", "°/s", "cm/s", "Nm", "kg"))


def by_values(rng, d):
    """No units at all: rotation in deg/s, an angle that starts again, time in ms."""
    columns = {"timestamp": 1000 * d.time + 1.7e12, "motor rate": np.degrees(d.rim / RADIUS),
               "position x": 1000 * noisy(rng, d.place, 0.0005),
               "moment": -noisy(rng, d.torque, 0.05), "normal force": -d.load}  # fmt: skip
    return columns, (",", ".", "utf-8", ("% radius: 150 mm",), None)


def in_german(rng, d):
    columns = {"Zeit [ms]": 1000 * d.time, "Drehzahl [1/min]": d.rim / RADIUS * 30 / np.pi,
               "Wagen Weg [mm]": noisy(rng, 1000 * d.place, 0.5),
               "Drehmoment [Nm]": d.torque, "Radlast [N]": d.load,
               "Zugkraft [N]": 13.0 + 0.3 * d.torque / RADIUS}  # fmt: skip
    return columns, (";", ",", "utf-16", ("Radius: 150 mm",), None)


@pytest.mark.slow
@pytest.mark.parametrize("log", [by_name, by_unit_row, by_values, in_german])
def test_guesses_give_the_truth(log, tmp_path):
    """With the radius filled in where the log does not state it, and nothing else."""
    rng = np.random.default_rng(40)
    d = drive(rng, slips=SLIPS, seconds=10)
    columns, (separator, decimal, encoding, head, units) = log(rng, d)
    if log is by_values:
        columns = {k: v for k, v in columns.items() if k != "motor rate"} | {
            "wheel angle": np.degrees(d.rim_place / RADIUS) % 360
        }
    path = write_csv(tmp_path / "log.csv", columns, separator, decimal, encoding, head, units)
    edits = [] if any("adius" in line for line in head) else [RADIUS_EDIT]
    table = imported(tmp_path, path, edits)[0].table
    np.testing.assert_allclose(table["slip"], SLIPS, atol=0.02)
    np.testing.assert_allclose(table["torque_Nm"], torque_law(SLIPS), rtol=0.08)
    np.testing.assert_allclose(table["load_N"], LOAD, rtol=0.02)
    if log is in_german:
        np.testing.assert_allclose(
            table["drawbar_pull_N"], 0.3 * table["torque_Nm"] / RADIUS, rtol=0.05
        )


def test_every_line_of_a_map_that_needs_a_look_says_so(tmp_path):
    d = drive(np.random.default_rng(41), slips=(0.2,))
    columns = {"t": d.time, "encoder": np.floor(1e4 * d.rim_place), "motor_current": d.torque,
               "vx": d.ground}  # fmt: skip
    log = write_csv(tmp_path / "log.csv", columns)
    text = init_map(log)
    marked = [line for line in text.splitlines()[3:] if "CHANGE" in line or "NEEDED" in line]
    assert draft_map(log).marked == len(marked) > 4
    for word in ("counts_per_turn", "torque_constant", "efficiency", "radius", "vehicle"):
        assert any(word in line for line in marked), (word, text)


def test_wheels_are_told_apart_by_their_names(tmp_path):
    d = drive(np.random.default_rng(42), slips=(0.2,))
    columns = {"stamp": d.time, "odom_vx": d.ground}
    for name in ("FL", "FR", "RL", "RR"):
        columns[f"{name}_wheel_vel"] = d.rim / RADIUS
        columns[f"{name}_torque"] = d.torque
    path = write_csv(tmp_path / "log.csv", columns)
    edits = [RADIUS_EDIT, ("# [vehicle] ", "[vehicle] "), ("# wheels =", "wheels ="),
             ('# mass = "6.1 kg +- 0.1 kg"', f"mass = {4 * LOAD / 9.80665}")]  # fmt: skip
    table = imported(tmp_path, path, edits)[0].table
    assert list(table["wheel"]) == ["front_left", "front_right", "rear_left", "rear_right"]
    np.testing.assert_allclose(table["load_N"], LOAD, rtol=1e-5)


def test_a_table_of_runs_is_no_log(tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text("run,slip,load_N,torque_Nm\n" + "a,0.1,60,1.5\n" * 9)
    with pytest.raises(InputError, match="is a table of runs already"):
        init_map(path)


def test_slip_and_load_in_the_names_of_files(tmp_path):
    rng, logs = np.random.default_rng(43), []
    for slip in (10, 30, 50):
        d = drive(rng, slips=(slip / 100,))
        columns = {"Time (s)": d.time, "Torque (Nm)": noisy(rng, d.torque, 0.05)}
        logs.append(write_csv(tmp_path / f"slip{slip}_load60N_rep1.csv", columns))
    table = imported(tmp_path, logs)[0].table
    np.testing.assert_allclose(table["slip"], SLIPS)
    assert set(table["load_N"]) == {60.0}
    np.testing.assert_allclose(table["torque_Nm"], torque_law(SLIPS), rtol=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_several_runs_in_one_file(named, tmp_path):
    """A column that names them, or a clock that starts again."""
    rng = np.random.default_rng(44)
    drives = [drive(rng, slips=(slip,)) for slip in SLIPS]
    columns = {"trial": [f"T{i}" for i, d in enumerate(drives) for _ in d.time]} if named else {}
    columns |= {
        "time": np.concatenate([d.time for d in drives]),
        "wheel angle": np.concatenate([np.degrees(d.rim_place / RADIUS) for d in drives]),
        "x": np.concatenate([d.place for d in drives]),
        "torque": np.concatenate([d.torque for d in drives]),
        "Fz": np.concatenate([d.load for d in drives]),
    }
    path = write_csv(tmp_path / "all.csv", columns)
    table = imported(tmp_path, path, [RADIUS_EDIT])[0].table
    assert list(table["run"]) == (["T0", "T1", "T2"] if named else ["all_01", "all_02", "all_03"])
    np.testing.assert_allclose(table["slip"], SLIPS, atol=0.02)


@pytest.fixture
def rig_logs(tmp_path):
    """UTF-16, semicolons, decimal commas, degrees of a motor before a gearbox, a pull sensor that
    reads 14 N at rest, a burst of NaN, a dead torque sensor in one run, and in another somebody
    who pulls on the carriage at the end."""
    rng, logs = np.random.default_rng(45), []
    for k in range(4):
        d = drive(rng, slips=(0.1, 0.3, 0.5), seconds=9)
        if k == 3:
            late = d.time > d.time[-1] - 5.0
            push = np.repeat(rng.standard_normal(d.time.size // 12 + 1), 12)[: d.time.size]
            d.ground = np.where(late, d.ground + 0.03 * push, d.ground)
        pull = np.where(d.rim > 0, 0.3 * d.torque / RADIUS, 0.0)
        torque = np.full(d.time.size, 0.0031) if k == 2 else noisy(rng, d.torque, 0.05)
        columns = {
            "Zeit [ms]": 1000 * d.time,
            "Motor Position [°]": np.degrees(d.rim_place / RADIUS) * 99,
            "Wagen Position [mm]": noisy(rng, 1000 * d.place, 0.5),
            "Torque [mNm]": 1000 * torque,
            "Fx [N]": noisy(rng, 14.0 + pull, 0.5),
            "Fz [N]": noisy(rng, -d.load, 0.5),
        }
        burst = (d.time > 8.0) & (d.time < 8.3)
        for name in ("Fx [N]", "Fz [N]"):
            columns[name] = np.where(burst, np.nan, columns[name])
        path = tmp_path / f"test_{k}.csv"
        logs.append(write_csv(path, columns, ";", ",", "utf-16", ("Rig 3", "Radius: 150 mm")))
    return logs


@pytest.mark.slow
def test_the_traps_of_real_logs(rig_logs, tmp_path, capsys):
    """By the commands, with one line of the map changed: the gear ratio, which no log tells."""
    logs, chart = [str(path) for path in rig_logs], str(tmp_path / "map.toml")
    out = tmp_path / "runs.csv"
    assert main(["import", "--init", *logs, "--out", chart]) == 0
    assert main(["import", *logs, "--map", chart, "--out", str(out)]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    ratio = float(re.search(r"gearbox of up to ([\d.]+) to 1", said)[1])
    assert 99 <= ratio < 125  # at no slip it would be 99
    text = (tmp_path / "map.toml").read_text()
    (tmp_path / "map.toml").write_text(text.replace("gear_ratio = 1 ", "gear_ratio = 99 "))
    assert main(["import", *logs, "--map", chart, "--out", str(out)]) == 0
    said = printed(capsys)
    assert "run test_2: the sensor of [torque] is dead: it reads 0.0031 throughout" in said
    table = read_table(out, ("run", "slip", "load_N", "torque_Nm"))
    by_run = dict(table.groups())
    for name in ("test_0", "test_1", "test_2"):
        np.testing.assert_allclose(by_run[name]["slip"], SLIPS, atol=0.02)
        np.testing.assert_allclose(by_run[name]["load_N"], LOAD, rtol=0.02)
    alive = by_run["test_0"]
    np.testing.assert_allclose(alive["torque_Nm"], torque_law(SLIPS), rtol=0.08)
    np.testing.assert_allclose(
        alive["drawbar_pull_N"], 0.3 * alive["torque_Nm"] / RADIUS, rtol=0.05
    )
    assert np.isnan(by_run["test_2"]["torque_Nm"]).all()
    end = 3.0 + 3 * 9.0 - 5.0
    assert np.all(by_run["test_3"]["time_s"] < end)
    assert "nothing stays the same for" in (tmp_path / "runs.report.html").read_text()
    assert (tmp_path / "runs.bias.toml").read_text().count("[bias]") >= 1


def test_the_command_refuses_in_one_line(rig_logs, tmp_path, capsys):
    log = str(rig_logs[0])
    (tmp_path / "old.toml").write_text("")
    (tmp_path / "text.toml").write_text("t;F\n")
    for command, words in (
        (["import", log, "--out", "runs.csv"], "--map is missing"),
        (["import", "--init", log, "--out", str(tmp_path / "old.toml")], "would overwrite it"),
        (["import", log, "--map", str(tmp_path / "text.toml")], "is not valid TOML"),
        (["import", "--init", log, "--map", log], "--init writes a map"),
        (["import", "--init", str(tmp_path / "no.csv")], "no such file"),
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert words in said and said.strip().count("\n") <= 1, said


def test_measured_tables_are_looked_at():
    """Published tests: a plate is no rig with a wheel; rows of two wheels are said."""
    folder = os.environ.get("SOILML_DATA", "")
    logs = sorted(Path(folder).glob("*/*.csv")) if folder else []
    if not logs:
        pytest.skip("SOILML_DATA does not name a folder with measured tests")
    for log in logs:
        try:
            text = init_map(log)
        except InputError as error:
            assert "is a table of runs already" in str(error)
            continue
        content = tomllib.loads(text)
        if log.name == "single_wheel_tests.csv":  # Each row is a steady run
            remarks = import_log(log, content).remarks
            assert any("rows of several wheels" in r.text for r in remarks)
            continue
        with pytest.raises(InputError, match="is missing"):
            import_log(log, content)


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_a_map_of_any_names_can_be_read(tmp_path, ending):
    """Control characters of names and heads, which TOML does not have in comments or in quotes."""
    d = drive(np.random.default_rng(4), slips=SLIPS, seconds=10)
    values = (d.time, d.rim / RADIUS, d.ground, d.torque, d.load)
    names = ["time_s", "wheel_speed \x1b[31m rad_s", "ground_speed\x7f\u202e_m_s", "torque'\\q_Nm",
             "load\u200b_#N"]  # fmt: skip
    log = tmp_path / f"a\x1b\n.{ending}"
    if ending == "csv":
        write_csv(log, dict(zip(names, values, strict=True)), head=(f"radius: {RADIUS} m \x07",))
    else:
        names[4] = "load\n_N \ud800"
        log.write_text(json.dumps(dict(zip(names, (list(v) for v in values), strict=True))))
        names[4] = "load\n_N ?"
    text = init_map(log)
    assert text.isprintable() or {*filter(lambda c: not c.isprintable(), text)} == {"\n"}
    content = tomllib.loads(text)
    roles = ("wheel_speed", "ground_speed", "torque", "load")
    assert [content["time"]["column"], *(content[role]["column"] for role in roles)] == names
    if ending == "csv":
        (tmp_path / "map.toml").write_text(text, encoding="utf-8")
        assert len(import_log(log, tmp_path / "map.toml").table) == len(SLIPS)


def test_a_kind_of_files_whose_word_has_a_dot(tmp_path):
    columns = {"imu.v2": "time_s,wheel_speed_rad_s", "cart": "time_s,torque_Nm"}
    for name, header in columns.items():
        for run in "ab":
            lines = [header, *(f"{0.1 * i:.1f},{1 + i % 3}" for i in range(40))]
            (tmp_path / f"{run}_{name}.csv").write_text("\n".join(lines))
    content = tomllib.loads(init_map(sorted(tmp_path.glob("*.csv"))))
    assert content["files"]["imu_v2"]["pattern"] == "*imu.v2*"
