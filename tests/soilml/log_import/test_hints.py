"""Maps and tables that cannot be right are caught, with the mistake that was made as the cause."""

import numpy as np
import pytest
from simulated_rig import LOAD, RADIUS, drive, torque_law, write_csv

from soilml.cli import main
from soilml.errors import InputError
from soilml.log_import import import_log
from soilml.log_import.checks.table_hints import table_hints


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log in SI units of a wheel that drives at three slips."""
    d = drive(np.random.default_rng(30), seconds=8)
    own = np.random.default_rng(1).normal(0.0, 0.02, d.time.size)
    columns = {"t": d.time, "w": d.rim / RADIUS, "v": d.ground, "T": d.torque, "Fz": d.load,
               "Fx": np.where(d.rim > 0, 0.3 * d.torque / RADIUS, 0.0),
               "I": np.where(d.rim > 0, d.torque / (0.05 * 40) + own, 0.0),
               "pitch": np.full(d.time.size, 8.0)}  # fmt: skip
    return write_csv(tmp_path_factory.mktemp("hints") / "log.csv", columns)


def right():
    return {
        "time": {"column": "t"},
        "wheel": {"radius": RADIUS},
        "wheel_speed": {"column": "w"},
        "ground_speed": {"column": "v"},
        "torque": {"column": "T"},
        "load": {"column": "Fz"},
    }


def changed(table, **keys):
    content = right()
    content[table] = content.get(table, {}) | keys
    return content


def current(**keys):
    content = right()
    del content["torque"]
    usual = {"column": "I", "gear_ratio": 40, "torque_constant": "50 mN m/A"}
    return content | {"motor_current": usual | keys}


def test_a_right_map_gets_no_hint(log):
    imported = import_log(log, right())
    assert imported.implausible == () and imported.remarks == ()
    assert import_log(log, current()).remarks == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "cause"),
    [
        # what the log has in SI units is taken for another unit: the wrong number arrives
        (changed("torque", unit="kN m"), "the torque is in N m and was read as kN m"),
        (changed("load", unit="N", reverse=True), "reverse = true in [load]"),
        (
            changed("wheel_speed", unit="turns/s"),
            "the wheel speed is in rad/s and was read as turns/s",
        ),
        (changed("wheel", radius=2 * RADIUS), "was the radius of 0.3 m measured as diameter?"),
        (changed("ground_speed", reverse=True), "reverse = true in [ground_speed]"),
        (changed("torque", reverse=True), "reverse = true in [torque]"),
        (changed("ground_speed", unit="km"), "unit 'km' does not give m/s"),
        (changed("torque", gear_ratio=40), "remove gear_ratio"),
        (changed("slope", column="pitch"), "probably it is in degrees"),
        (changed("vehicle", mass=9.81 * LOAD / 9.80665), "unit = 'kgf' in [load]"),
        (current(torque_constant="50 N m/A"), "mN m/A"),
        (current(gear_ratio=1), "gear_ratio"),
        (changed("wheel", radius=150), "radius is in mm"),
    ],
)
def test_a_wrong_map_is_refused_with_the_cause(log, content, cause):
    with pytest.raises(InputError) as raised:
        import_log(log, content)
    assert cause in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("factor", "cause"),
    [(180 / np.pi, "is in deg"), (30 / np.pi, "is in rpm"), (99.0, "before a gearbox of up to")],
)
def test_a_rotation_in_another_unit(tmp_path, factor, cause):
    d = drive(np.random.default_rng(31), seconds=8)
    columns = {"t": d.time, "w": factor * d.rim / RADIUS, "v": d.ground, "T": d.torque,
               "Fz": d.load}  # fmt: skip
    path = write_csv(tmp_path / "log.csv", columns)
    with pytest.raises(InputError, match=cause):
        import_log(path, right())
    imported = import_log(path, right() | {"slip": {"value": 0.3}}, accept=True)
    assert set(imported.table["slip"]) == {0.3}


def rows(**changes):
    slip = np.array([0.1, 0.2, 0.4, 0.6])
    table = {"slip": slip, "load_N": np.full(4, LOAD), "torque_Nm": torque_law(slip),
             "drawbar_pull_N": 20 * slip, "sinkage_m": 0.01 + 0.02 * slip}  # fmt: skip
    return table | {name: change(table[name]) for name, change in changes.items()}


@pytest.mark.parametrize(
    ("changes", "hint"),
    [
        ({"load_N": lambda x: x / 9.81}, "the load is in kg"),
        ({"torque_Nm": lambda x: 1000 * x}, "the torque is in mN m"),
        ({"torque_Nm": lambda x: 100 * x}, "the torque is in N cm"),
        ({"torque_Nm": lambda x: x / 1000}, "the torque is in kN m"),
        ({"torque_Nm": lambda x: -x}, "its sign is turned"),
        ({"slip": lambda x: 0.9 + x / 10}, "before a gearbox"),
        ({"slip": lambda x: 0.5 + x / 2}, "radius given as diameter"),
        ({"slip": lambda x: x / 100}, "divided by 100 twice"),
        ({"drawbar_pull_N": lambda x: 1000 + x}, "was not tared"),
        ({"drawbar_pull_N": lambda x: -x}, "its sign is turned"),
        ({"sinkage_m": lambda x: 1000 * x}, "is in mm and was read as m"),
        ({"sinkage_m": lambda x: 100 * x}, "is in cm and was read as m"),
        ({"sinkage_m": lambda x: 400 * x}, "is in cm and was read as m, or the sinkage is in mm"),
        ({"sinkage_m": lambda x: 1e5 * x}, "is no length"),
    ],
)
def test_hints_of_a_table(changes, hint):
    assert table_hints(rows(), RADIUS) == []
    found = table_hints(rows(**changes), RADIUS)
    assert any(hint in remark.text for remark in found), found


def test_a_pull_that_a_sinking_wheel_loses_with_slip_is_no_turned_sign():
    assert table_hints(rows(drawbar_pull_N=lambda x: 15.0 - x), RADIUS) == []


@pytest.mark.slow
def test_identify_and_estimate_give_the_same_hint(tmp_path, model_file, capsys):
    lines = [f"a,{s},{LOAD / 9.81:.4f},{t:.4f}" for s, t in zip(*rows_of_torque(), strict=True)]
    runs = tmp_path / "runs.csv"
    runs.write_text("run,slip,load_N,torque_Nm\n" + "\n".join(lines) + "\n")
    model = str(model_file)
    for command in (
        ["identify", model, str(runs), "--method", "nonlinear"],
        ["estimate", "exported/any_wheel.onnx", str(runs), "--model", model, "--by", "run"],
    ):
        main(command)
        assert "! " + str(runs) + ": torque is" in (said := capsys.readouterr().err), command
        assert "the load is in kg and was read as N" in said


def rows_of_torque():
    slip = np.linspace(0.05, 0.6, 12)
    return slip, torque_law(slip)
