"""Logs of rigs and rovers as others write them: what is guessed, and what comes out."""

import numpy as np
import pytest
from simulated_rig import RADIUS, drive, imported, torque_law, write_csv

from soilml.errors import InputError
from soilml.log_import import import_log, init_map

SLIPS = (0.1, 0.3, 0.5)
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


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


@pytest.mark.parametrize(
    ("names", "second"), [(("wheel1", "wheel2"), "wheel_2"), (("FL", "FR"), "front_right")]
)
def test_structs_of_wheels_are_wheels(names, second, tmp_path):
    from scipy.io import savemat

    d = drive(np.random.default_rng(73), slips=(0.2,))
    own = {"t": d.time, "omega": d.rim / RADIUS, "torque": d.torque, "Fz": d.load}
    wheels = dict.fromkeys(names, own)
    savemat(tmp_path / "w.mat", {**wheels, "body": {"t": d.time, "v": d.ground}})
    text = init_map(tmp_path / "w.mat")
    assert "each_struct" not in text and f"[wheels.{second}.torque]" in text
    text = (
        '[time]\ncolumn = "t"\n[runs]\neach_struct = true\n[slip]\nvalue = 0.1\n[load]\nvalue = 1'
    )
    write_csv(tmp_path / "one.csv", {"t": d.time, "T": d.torque})
    (tmp_path / "map.toml").write_text(text + '\n[torque]\ncolumn = "T"\nunit = "N m"')
    with pytest.raises(InputError, match="no two structs with the same columns"):
        import_log(tmp_path / "one.csv", tmp_path / "map.toml")


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
