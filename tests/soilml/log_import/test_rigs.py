"""Rigs of other laboratories: each log once failed to be guessed or to be read rightly."""

import numpy as np
import pytest
from simulated_rig import LOAD, RADIUS, RADIUS_EDIT, drive, imported, torque_law, write_csv

from soilml.errors import InputError
from soilml.log_import import init_map
from soilml.log_import.checks.table_hints import table_hints
from soilml.remarks import about

SLIPS = (0.1, 0.3, 0.5)


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
    assert {remark.code for remark in found.remarks} == {"dead-sensor"}
    assert all("run_2" in remark.about for remark in found.remarks)
    assert list(found.table["run"]) == ["run_0", "run_1", "run_3"]


def test_plate_tests_are_sent_to_the_bevameter(tmp_path):
    depth = np.linspace(0.0, 0.05, 30)
    columns = {"time": 0.1 * np.arange(30.0), "plate sinkage [m]": depth,
               "plate pressure [kPa]": 900.0 * depth}  # fmt: skip
    assert "soilml bevameter" in init_map(write_csv(tmp_path / "p.csv", columns))
