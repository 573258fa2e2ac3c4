"""Rigs of other laboratories: each log once failed to be guessed or to be read rightly."""

import datetime

import numpy as np
import pytest
from simulated_rig import LOAD, RADIUS, drive, torque_law, write_csv

from soilml.cli import main
from soilml.errors import InputError
from soilml.io.text_tables import csv_text
from soilml.log_import import import_log, init_map
from soilml.log_import.checks.table_hints import table_hints
from soilml.remarks import about, texts

SLIPS = (0.1, 0.3, 0.5)
RADIUS_EDIT = ('# radius = "0.15 m', 'radius = "0.15 m')


def imported(folder, logs, edits=()):
    text = init_map(logs)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text)
    return import_log(logs, folder / "map.toml"), text


def noisy(rng, values, std):
    return values + std * rng.standard_normal(values.size)


def test_increments_a_force_sensor_upside_down_and_a_laser(tmp_path):
    """A German rig: counts of a draw wire and of a motor, no axis tared, distance to the ground."""
    rng = np.random.default_rng(80)
    d = drive(rng, slips=SLIPS, seconds=10)
    current = 0.18 * (d.rim > 0) + d.torque / (43 * 0.0302 * 0.78)
    pull = np.where(d.rim > 0, 0.8 * d.torque / RADIUS - 10.0, 0.0)
    sunk = np.where(d.rim > 0, 16.0 + 2.0 * d.torque, 12.0)
    columns = {
        "Zeit": 1000 * d.time,
        "Weg_Schlitten": np.floor(d.place / (np.pi * 0.04) * 2000),
        "Encoder_Rad": np.floor(d.rim_place / RADIUS / 2 / np.pi * 43 * 4096) + 1234,
        "Strom_Motor": noisy(rng, current, 0.01),
        "Kraft_X": noisy(rng, 13.2 - pull, 0.3),
        "Kraft_Y": noisy(rng, np.full(d.time.size, 4.1), 0.3),
        "Kraft_Z": noisy(rng, -17.5 - d.load, 0.4),
        "Laser": noisy(rng, 182.4 - sunk, 0.1),
    }
    head = ("# Rad: Durchmesser 300 mm, Breite 100 mm", "# Getriebe 43:1")
    units = ("ms", "Inkr", "Inkr", "A", "N", "N", "N", "mm")
    log = write_csv(tmp_path / "m.csv", columns, ";", ",", "latin-1", head, units)
    edits = [("counts_per_turn = 1 ", "counts_per_turn = 4096 "),
             ('scale = "1 mm"', 'scale = "0.0628319 mm +- 0.5 %"'),
             ('"1.0 N m/A +- 5 %"', '"0.0302 N m/A"'), ('"0.7 +- 0.05"', "0.78"),
             ('"0 A +- 0.02 A"', '"0.18 A"')]  # fmt: skip
    found, text = imported(tmp_path, log, edits)
    assert 'column = "Kraft_Z"' in text and "NEEDED;" not in text
    table = found.table
    np.testing.assert_allclose(table["slip"], SLIPS, atol=0.02)
    np.testing.assert_allclose(table["torque_Nm"], torque_law(SLIPS), rtol=0.08)
    expected = 0.8 * torque_law(SLIPS) / RADIUS - 10.0
    np.testing.assert_allclose(table["drawbar_pull_N"], expected, atol=1.5)
    # counted from the resting wheel, and falling readings are rising sinkage
    np.testing.assert_allclose(table["sinkage_m"], (4 + 2 * torque_law(SLIPS)) / 1e3, atol=1e-3)
    # the scale's uncertainty is that of the travel, and so of slip, in all rows
    assert found.bias["slip"].constant > 0.003
    assert about(found.remarks, "load-not-tared") == {"load", "drawbar_pull"}


def test_abbreviations_and_times_of_day(tmp_path):
    rng = np.random.default_rng(81)
    logs = []
    for k, slip in enumerate(SLIPS):
        d = drive(rng, slips=(slip,), seconds=12, rate=25.0)
        start = datetime.datetime(2025, 4, 7, 9, 10 + k)
        stamps = [(start + datetime.timedelta(seconds=float(t))).isoformat() for t in d.time]
        columns = {"TIME": stamps, "FX": 0.1 * d.torque / RADIUS, "Fz_N": d.load,
                   "M_w": d.torque, "om": d.rim / RADIUS, "v_c": d.ground,
                   "s[%]": np.where(d.rim > 0, 100.0 * slip, 0.0),
                   "h_mm": np.where(d.rim > 0, 16.0, 14.0)}  # fmt: skip
        name = tmp_path / f"run{k}.txt"
        logs.append(write_csv(name, columns, "\t", ".", "utf-16", ("Testbed v2", "Operator\tJD")))
    found, text = imported(tmp_path, logs)
    assert "v / (omega (1 - slip)) with the slip of the column 's'" in text
    for role, column in (("torque", "M_w"), ("ground_speed", "v_c"), ("sinkage", "h_mm")):
        assert f"[{role}]  #" in text and f'column = "{column}"' in text
    true = np.asarray(SLIPS)[[int(run[-1]) for run in found.table["run"]]]
    assert set(true) == set(SLIPS)
    np.testing.assert_allclose(found.table["slip"], true, atol=0.04)
    np.testing.assert_allclose(found.table["torque_Nm"], torque_law(true), rtol=0.2)
    # a wheel that has sunk in at rest is no sensor without a tare
    assert not any("sinkage" in remark.about for remark in found.remarks)


def test_runs_that_a_pause_separates_and_forces_in_kg(tmp_path):
    drives = [drive(np.random.default_rng(82 + k), slips=(s,), seconds=10, rate=25.0)
              for k, s in enumerate(SLIPS)]  # fmt: skip
    join = np.concatenate
    columns = {
        "time_ms": join([1000 * d.time + 60_000 * k for k, d in enumerate(drives)]),
        "wheel_rpm": join([d.rim / RADIUS * 30 / np.pi for d in drives]),
        "carriage_mm_s": join([1000 * d.ground for d in drives]),
        "torque_mNm": join([1000 * d.torque for d in drives]),
        "loadcell_kg": join([d.load / 9.80665 for d in drives]),
        "pull_kg": join([0.1 * d.torque for d in drives]),
    }
    found, text = imported(tmp_path, write_csv(tmp_path / "b.csv", columns), [RADIUS_EDIT])
    assert "split_at_pauses_over" in text
    assert list(found.table["run"]) == ["b_01", "b_02", "b_03"]
    np.testing.assert_allclose(found.table["load_N"], LOAD, rtol=0.02)
    np.testing.assert_allclose(
        found.table["drawbar_pull_N"], 0.980665 * found.table["torque_Nm"], rtol=0.02
    )


@pytest.mark.parametrize(
    ("definition", "of_ours"),
    [("v/(r omega)", lambda s: 1 - s), ("(r omega - v)/v", lambda s: s / (1 - s))],
)
def test_slip_by_other_definitions(definition, of_ours, tmp_path):
    """Taken for ours, the ratio of travel is refused with its cause; stated, all are right."""
    logs = []
    for k, slip in enumerate(SLIPS):
        d = drive(np.random.default_rng(83 + k), slips=(slip,), seconds=10, rate=25.0)
        columns = {"t": d.time, "slip": np.full(d.time.size, of_ours(slip)),
                   "torque": d.torque, "Fz": d.load}  # fmt: skip
        logs.append(write_csv(tmp_path / f"{k}.csv", columns))
    if definition == "v/(r omega)":
        with pytest.raises(InputError, match="write definition = 'v/"):
            imported(tmp_path, logs, [RADIUS_EDIT])
        columns = {"slip": np.array([0.9, 0.7, 0.5]), "load_N": np.full(3, LOAD),
                   "torque_Nm": torque_law(np.array(SLIPS))}  # fmt: skip
        assert about(table_hints(columns, RADIUS), "slip-definition") == {"slip", "torque_Nm"}
    stated = ('column = "slip"', f'column = "slip"\ndefinition = "{definition}"')
    found, _ = imported(tmp_path, logs, [RADIUS_EDIT, stated])
    np.testing.assert_allclose(found.table["slip"], SLIPS, atol=1e-6)
    with pytest.raises(InputError, match="definition is 'v'; needed is one of"):
        imported(tmp_path, logs, [("[slip]", '[slip]\ndefinition = "v"')])


def test_a_load_that_each_log_states_for_itself(tmp_path):
    logs = []
    for k, load in enumerate((50, 90)):
        d = drive(np.random.default_rng(86 + k), slips=(0.3,), seconds=8, load=load)
        columns = {"t": d.time, "omega": d.rim / RADIUS, "v": d.ground, "torque": d.torque}
        head = ("Radius: 150 mm", f"Normal load: {load} N")
        logs.append(write_csv(tmp_path / f"{k}.csv", columns, head=head))
    found, text = imported(tmp_path, logs)
    assert "head = " in text and "value" not in text.split("[load]")[1].split("[")[0]
    assert found.table["load_N"].tolist() == [50.0, 90.0]


def test_a_load_that_each_struct_states_for_itself(tmp_path):
    from scipy.io import savemat

    tests = np.empty(2, dtype=[(n, object) for n in ("t", "omega", "vx", "Mt", "F", "normal_load")])
    for k, load in enumerate((60.0, 100.0)):
        d = drive(np.random.default_rng(88 + k), slips=(0.3,), seconds=8, load=load)
        forces = np.stack([0.1 * d.torque / RADIUS, 0.0 * d.load], axis=1)
        tests[k] = (d.time, d.rim / RADIUS, d.ground, d.torque, forces, load)
    savemat(tmp_path / "all.mat", {"tests": tests, "R_wheel": RADIUS})
    found, text = imported(tmp_path, tmp_path / "all.mat")
    assert "stated in the log: R_wheel" in text and 'column = "Mt"' in text
    assert found.table["load_N"].tolist() == [60.0, 100.0]


@pytest.mark.slow
def test_the_table_of_an_earlier_import_is_no_log(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    d = drive(np.random.default_rng(92), slips=(0.3,), seconds=8)
    write_csv(tmp_path / "a.csv", {"t": d.time, "w": d.rim / RADIUS, "v": d.ground,
                                   "torque": d.torque, "Fz": d.load})  # fmt: skip
    (tmp_path / "map.toml").write_text(init_map("a.csv").replace("# radius", "radius"))
    for _ in range(2):
        assert main(["import", *sorted(p.name for p in tmp_path.glob("*.csv")),
                     "--map", "map.toml", "--out", "runs.csv"]) == 0  # fmt: skip
    assert "runs.csv is a table of runs and no log" in capsys.readouterr().err
    (tmp_path / "b.csv").write_text(csv_text({"t": d.time, "v": d.ground}))
    assert main(["import", "a.csv", "b.csv", "--map", "map.toml", "--out", "b.csv"]) == 2
    assert "b.csv is an input and would be overwritten" in capsys.readouterr().err


def test_a_run_without_data_is_one_line(tmp_path):
    logs = []
    for k in range(4):
        d = drive(np.random.default_rng(93 + k), slips=(0.3,), seconds=8)
        columns = {"t": d.time, "omega": d.rim / RADIUS, "v": d.ground, "torque": d.torque,
                   "Fz": d.load}  # fmt: skip
        if k == 2:
            columns = {name: (0.0 if name != "t" else 1.0) * v for name, v in columns.items()}
        logs.append(write_csv(tmp_path / f"run_{k}.csv", columns))
    found, _ = imported(tmp_path, logs, [RADIUS_EDIT])
    assert texts(found.remarks) == ["run run_2: no sensor says anything: an empty log?"]
    assert list(found.table["run"]) == ["run_0", "run_1", "run_3"]


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ('unit = "mm"', 'unit = "m"', r"\[sinkage\]"),
        ('unit = "Nm"', 'unit = "mN m"', r"\[torque\] is in N m, and was read as mN m"),
        ('unit = "rpm"', 'unit = "deg/s"', r"\[wheel_speed\] is in rpm, and was read as deg/s"),
        ('unit = "deg"', 'unit = "rad"', "the slope goes to 10.6 rad: probably it is in degrees"),
    ],
)
def test_a_wrong_unit_is_refused_with_its_cause(old, new, cause, tmp_path):
    d = drive(np.random.default_rng(97), slips=SLIPS, seconds=8)
    columns = {"t": d.time, "wheel_rpm": d.rim / RADIUS * 30 / np.pi, "v_m_s": d.ground,
               "torque_Nm": d.torque, "sinkage_mm": np.where(d.rim > 0, 16.0, 14.0),
               "pitch_deg": np.full(d.time.size, 10.0) + 0.01 * d.load}  # fmt: skip
    edits = [RADIUS_EDIT, ("# [vehicle]", "[vehicle]"), ('# mass = "6.1', 'mass = "6.1'),
             (old, new)]  # fmt: skip
    with pytest.raises(InputError, match=cause):
        imported(tmp_path, write_csv(tmp_path / "log.csv", columns), edits)


def test_plate_tests_are_sent_to_the_bevameter(tmp_path):
    depth = np.linspace(0.0, 0.05, 30)
    columns = {"time": 0.1 * np.arange(30.0), "plate sinkage [m]": depth,
               "plate pressure [kPa]": 900.0 * depth}  # fmt: skip
    assert "soilml bevameter" in init_map(write_csv(tmp_path / "p.csv", columns))
