"""Logs of rigs and rovers as others write them: what is guessed, and what comes out."""

import numpy as np
import pytest
from simulated_rig import LOAD, RADIUS, drive, torque_law, write_csv

from soilml.errors import InputError
from soilml.log_import import import_log, init_map
from soilml.log_import.checks.table_hints import table_hints
from soilml.remarks import about

SLIPS = (0.1, 0.3, 0.5)
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def imported(tmp_path, logs, edits=()):
    text = init_map(logs)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (tmp_path / "map.toml").write_text(text)
    return import_log(logs, tmp_path / "map.toml"), text


def test_a_place_in_x_y_and_z_is_one_place(tmp_path):
    """x alone is a share of the travel, and z of a rover is no sinkage; four wheels share keys."""
    rng = np.random.default_rng(70)
    d = drive(rng, slips=SLIPS, seconds=10)
    motor = d.rim_place / RADIUS / 2 / np.pi * 71 * 2048
    columns = {"time": d.time} | {f"{w}_enc_ticks": np.round(motor) for w in WHEELS}
    columns |= {f"{w}_current_A": d.torque / 71 / 0.03 for w in WHEELS}
    for axis, share in (("x", np.cos(1.2)), ("y", np.sin(1.2)), ("z", 0.0)):
        columns[f"vo_{axis}"] = share * d.place + 0.0005 * rng.standard_normal(d.time.size)
    edits = [("# radius", "radius"), ("counts_per_turn = 1 ", "counts_per_turn = 2048 "),
             ("gear_ratio = 1 ", "gear_ratio = 71 "), ('"1.0 N m/A', '"0.03 N m/A'),
             ('efficiency = "0.7', 'efficiency = "1.0'), ("# [vehicle]", "[vehicle]"),
             ('# mass = "6.1', 'mass = "24.5'), ("# wheels = 4", "wheels = 4")]  # fmt: skip
    found, text = imported(tmp_path, write_csv(tmp_path / "rover.csv", columns), edits)
    assert 'column = ["vo_x", "vo_y", "vo_z"]' in text and "[sinkage]" not in text
    # four of the motor, the place whose unit nothing states, and the line that explains the word
    assert text.count("CHANGE") == 4 + 1 + 1
    assert len(found.table) == 12
    np.testing.assert_allclose(found.table["slip"], np.tile(SLIPS, 4), atol=0.02)
    np.testing.assert_allclose(found.table["torque_Nm"], np.tile(torque_law(SLIPS), 4), rtol=0.08)


@pytest.mark.parametrize("array", [True, False])
def test_a_struct_per_test_is_a_run(array, tmp_path):
    from scipy.io import savemat

    rng, tests = np.random.default_rng(72), []
    for load in (50.0, 80.0):
        d = drive(rng, slips=(0.2, 0.4), seconds=8, load=load)
        tests.append({"t": d.time, "omega": d.rim / RADIUS, "vel": d.ground, "T": d.torque,
                      "Fz": d.load})  # fmt: skip
    content = {f"test{i}": test for i, test in enumerate(tests, 1)}
    if array:
        content = np.empty(2, dtype=[(name, object) for name in tests[0]])
        for i, test in enumerate(tests):
            content[i] = tuple(test.values())
    savemat(tmp_path / "all.mat", {"tests": content, "info": {"radius_mm": 1000 * RADIUS}})
    found, text = imported(tmp_path, [tmp_path / "all.mat"])
    assert "each_struct = true" in text and "NEEDED;" not in text
    assert len(set(found.table["run"])) == 2
    np.testing.assert_allclose(found.table["slip"], [0.2, 0.4] * 2, atol=0.02)
    np.testing.assert_allclose(found.table["load_N"], [50, 50, 80, 80], rtol=0.02)


def test_structs_of_wheels_are_wheels(tmp_path):
    from scipy.io import savemat

    d = drive(np.random.default_rng(73), slips=(0.2,))
    own = {"t": d.time, "omega": d.rim / RADIUS, "torque": d.torque, "Fz": d.load}
    savemat(
        tmp_path / "w.mat", {"wheel1": own, "wheel2": own, "body": {"t": d.time, "v": d.ground}}
    )
    text = init_map(tmp_path / "w.mat")
    assert "each_struct" not in text and "[wheels.wheel_2.torque]" in text
    text = (
        '[time]\ncolumn = "t"\n[runs]\neach_struct = true\n[slip]\nvalue = 0.1\n[load]\nvalue = 1'
    )
    write_csv(tmp_path / "one.csv", {"t": d.time, "T": d.torque})
    (tmp_path / "map.toml").write_text(text + '\n[torque]\ncolumn = "T"\nunit = "N m"')
    with pytest.raises(InputError, match="no two structs with the same columns"):
        import_log(tmp_path / "one.csv", tmp_path / "map.toml")


def test_a_lifted_wheel_a_turned_pull_and_a_german_head(tmp_path):
    """No edit: the head states radius and gearbox, the rest is seen in the samples."""
    rng = np.random.default_rng(74)
    d = drive(rng, slips=SLIPS, seconds=10, rest=4.0)
    pull = np.where(d.rim > 0, 0.8 * d.torque / RADIUS - 10.0, 0.0)
    columns = {
        "Zt [s]": d.time,
        "Mot.Winkel [Grad]": 64 * np.degrees(d.rim_place / RADIUS),
        "Wg.Pos [mm]": 2000 - 1000 * d.place,
        "M_Rad [N mm]": 1000 * d.torque + 60 + 20 * rng.standard_normal(d.time.size),
        "F_Zug [N]": 17.0 - pull + 0.3 * rng.standard_normal(d.time.size),
        "F_N [N]": np.where(d.time < 2.0, 12.0, 12.0 + d.load),
        "Einsinkung [mm]": np.where(d.rim > 0, -12.0, 0.0),
    }
    head = ("Radradius:;150 mm", "Getriebe:;1:64")
    log = write_csv(tmp_path / "v.txt", columns, ";", ",", "utf-16", head)
    found, text = imported(tmp_path, log)
    assert "NEEDED;" not in text
    np.testing.assert_allclose(found.table["slip"], SLIPS, atol=0.02)
    np.testing.assert_allclose(found.table["load_N"], LOAD, rtol=0.01)
    np.testing.assert_allclose(found.table["torque_Nm"], torque_law(SLIPS), rtol=0.08)
    expected = 0.8 * torque_law(SLIPS) / RADIUS - 10.0
    np.testing.assert_allclose(found.table["drawbar_pull_N"], expected, atol=2.0)
    assert (found.table["sinkage_m"] > 0.0).all()


def test_a_pull_that_falls_with_slip_is_named():
    slip, load = np.array([0.1, 0.25, 0.4, 0.6]), np.full(4, 35.0)
    pull = np.array([5.3, 2.7, 0.7, -1.5])
    columns = {"slip": slip, "load_N": load, "drawbar_pull_N": pull}
    assert about(table_hints(columns, RADIUS), "sign") == {"drawbar_pull_N"}
    assert not table_hints(columns | {"drawbar_pull_N": -pull}, RADIUS)


@pytest.mark.parametrize("german", [True, False])
def test_thousands_are_read(german, tmp_path):
    d = drive(np.random.default_rng(75), slips=(0.2,))
    columns = {"time_ms": 1000 * d.time, "rpm": d.rim / RADIUS * 30 / np.pi,
               "v_mm_s": 1000 * d.ground, "torque (Nmm)": 1000 * d.torque,
               "Fz_N": d.load}  # fmt: skip
    swap = str.maketrans(",.", ".,") if german else {}
    quote = "" if german else '"'
    rows = [
        [quote + f"{value:,.3f}".translate(swap) + quote for value in row]
        for row in np.stack(list(columns.values()), axis=1)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join((";" if german else ",").join(line) for line in [columns, *rows]))
    found, _ = imported(tmp_path, path, [("# radius", "radius")])
    np.testing.assert_allclose(found.table["slip"], 0.2, atol=0.02)
    np.testing.assert_allclose(found.table["torque_Nm"], torque_law(0.2), rtol=0.08)


def test_a_commanded_slip_is_offered_and_the_rotation_is_asked_for(tmp_path):
    d = drive(np.random.default_rng(77), slips=(0.2,))
    columns = {"t": d.time, "slip_cmd_percent": np.full(d.time.size, 20.0), "torque": d.torque}
    text = init_map(write_csv(tmp_path / "log.csv", columns))
    assert "NEEDED: no column is the rotation" in text and '"slip_cmd_percent"' in text


def test_a_table_of_runs_among_logs_is_refused(tmp_path):
    d = drive(np.random.default_rng(78), slips=(0.2,))
    log = write_csv(tmp_path / "log.csv", {"t": d.time, "torque": d.torque, "Fz": d.load})
    runs = write_csv(tmp_path / "runs.csv", {"run": ["a"] * 9, "slip": [0.2] * 9,
                                             "load_N": [9.0] * 9})  # fmt: skip
    with pytest.raises(InputError, match="is a table of runs already"):
        init_map([log, runs])
