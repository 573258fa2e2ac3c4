"""Imported rows beside the truth of a simulated rig: values, standard deviations, shared errors."""

import numpy as np
import pytest
from log_files import FORMATS
from simulated_rig import LOAD, RADIUS, drive, scores, torque_law, write_csv

from soilml import read_case
from soilml.errors import InputError, TableError
from soilml.identification import identify
from soilml.io.read_table import read_table
from soilml.io.text_tables import csv_text
from soilml.log_import import import_log, init_map
from soilml.remarks import Remark

MAP = {
    "time": {"column": "t"},
    "wheel": {"radius": RADIUS},
    "torque": {"column": "torque"},
    "load": {"column": "Fz"},
}
SPEEDS = {"wheel_speed": {"column": "w"}, "ground_speed": {"column": "v"}}
PLACES = {
    "wheel_angle": {"column": "a", "unit": "deg", "gear_ratio": 50},
    "position": {"column": "x", "unit": "mm"},
}
SLOPE = np.radians(15.0)
SINE, COSINE = np.sin(SLOPE), np.cos(SLOPE)


def log_of(rng, path, **settings):
    """A log with speeds and with places, of sensors with noise."""
    d = drive(rng, **settings)
    n = d.time.size
    columns = {
        "t": d.time,
        "w": d.rim / RADIUS + 0.002 * rng.standard_normal(n),
        "v": d.ground + 0.001 * rng.standard_normal(n),
        "a": np.floor(50 * np.degrees(d.rim_place / RADIUS)),
        "x": 1000 * d.place + 0.5 * rng.standard_normal(n),
        "torque": d.torque + 0.05 * rng.standard_normal(n),
        "Fz": d.load + 0.5 * rng.standard_normal(n),
    }
    return write_csv(path, columns), d


@pytest.mark.slow
@pytest.mark.parametrize("motion", [SPEEDS, PLACES], ids=["speeds", "places"])
def test_stated_standard_errors_are_calibrated(motion, tmp_path):
    """Every stage of 20 logs gives a row; 90 % intervals hold the truth as often as they should."""
    rng = np.random.default_rng(20)
    found = {"slip": [], "torque_Nm": [], "load_N": []}
    truths = {"slip": lambda s: s, "torque_Nm": torque_law, "load_N": lambda s: LOAD}
    rows = 0
    for k in range(20):
        path, d = log_of(rng, tmp_path / f"{k}.csv", slips=(0.1, 0.2, 0.3, 0.5), seconds=10)
        imported = import_log(path, MAP | motion)
        rows += len(imported.table)
        for name, truth in truths.items():
            found[name] += scores(imported, d.stages, truth, name)
    assert 78 <= rows <= 84
    for name, values in found.items():
        share = np.mean(np.abs(values) < 1.645)
        # the sampling error of the share of 80 rows is 3.4 %
        assert 0.80 < share < 0.99, (name, share)
        assert 0.7 < np.std(values) < 1.35, name
        assert abs(np.mean(values)) < 0.5, name


def test_rows_are_a_table_of_runs_that_identify_takes(tmp_path, model_file):
    from soilml import read_case

    path, _ = log_of(np.random.default_rng(21), tmp_path / "log.csv", slips=(0.1, 0.2, 0.3, 0.5))
    imported = import_log(path, MAP | SPEEDS)
    (tmp_path / "runs.csv").write_text(csv_text(imported.table.columns))
    table = read_table(tmp_path / "runs.csv", ("run", "slip", "load_N", "torque_Nm"))
    assert list(table["run"]) == ["log"] * 4 and set(table["source"]) == {"log.csv"}
    assert np.all(table["torque_Nm_std"] > 0) and np.all(np.diff(table["time_s"]) > 0)
    assert identify(read_case(model_file), table, method="nonlinear").rows_used == 4


@pytest.mark.slow
@pytest.mark.parametrize("name", list(vars(FORMATS)))
def test_every_format_gives_the_same_rows(name, tmp_path):
    """Read by the map that init_map writes, with the radius filled in and nothing else."""
    if name == "matlab_73":
        pytest.importorskip("h5py")
    if name == "mcap_protobuf":
        pytest.importorskip("mcap_protobuf")
    if name in ("mcap", "mcap_protobuf", "ros1", "ros2"):
        pytest.importorskip("rosbags")
        pytest.importorskip("mcap")
    d = drive(np.random.default_rng(22), slips=(0.1, 0.4), seconds=9, rate=25.0)
    suffix, write = getattr(FORMATS, name)
    log = write(tmp_path / f"log{suffix}", d)
    text = init_map(log).replace('# radius = "0.15 m', 'radius = "0.15 m')
    (tmp_path / "map.toml").write_text(text)
    imported = import_log(log, tmp_path / "map.toml")
    np.testing.assert_allclose(imported.table["slip"], [0.1, 0.4], atol=0.02)
    np.testing.assert_allclose(imported.table["torque_Nm"], torque_law([0.1, 0.4]), rtol=0.08)
    np.testing.assert_allclose(imported.table["load_N"], LOAD, rtol=0.02)
    assert imported.remarks == ()


def test_torque_from_current_with_its_uncertainties(tmp_path):
    """T = eta G kt (I - I0), and each uncertainty in the bias that all rows share."""
    d = drive(np.random.default_rng(23))
    current = np.where(d.rim > 0, d.torque / (0.7 * 40 * 0.05) + 0.2, 0.0)
    path = write_csv(
        tmp_path / "log.csv",
        {"t": d.time, "w": d.rim / RADIUS, "v": d.ground, "I": 1000 * current},
    )
    content = {
        "time": {"column": "t"},
        "wheel": {"radius": "150 mm +- 1 %"},
        "vehicle": {"mass": f"{LOAD / 9.80665} kg +- 2 %"},
        "motor_current": {
            "column": "I",
            "unit": "mA",
            "gear_ratio": 40,
            "torque_constant": "50 mN m/A +- 3 %",
            "efficiency": "0.7 +- 0.028",
            "idle_current": "0.2 A +- 0.05 A",
        },
    } | SPEEDS
    imported = import_log(path, content)
    np.testing.assert_allclose(imported.table["torque_Nm"], torque_law([0.1, 0.3, 0.5]), rtol=0.05)
    bias = imported.bias
    assert bias["torque_Nm"].share == pytest.approx(np.hypot(0.03, 0.04), rel=0.02)
    assert bias["torque_Nm"].constant == pytest.approx(0.7 * 40 * 0.05 * 0.05, rel=0.02)
    assert bias["load_N"].share == pytest.approx(0.02, rel=1e-6)
    # ds = (1 - s) dr / r, as its root mean square
    expected = 0.01 * np.sqrt(np.mean((1.0 - imported.table["slip"]) ** 2))
    assert bias["slip"].constant == pytest.approx(expected, rel=0.02)
    assert np.isnan(imported.table.columns.get("load_N_std", np.nan)).all()


def test_the_bias_is_read_by_estimate(tmp_path, model_file):
    from soilml.config.case import read_case_of_one_gear
    from soilml.config.measurement_noise import checked_sensors

    path, _ = log_of(np.random.default_rng(24), tmp_path / "log.csv")
    content = MAP | SPEEDS | {"wheel": {"radius": "0.15 m +- 1 %"}}
    content["torque"] = {"column": "torque", "bias": "2 % + 0.05"}
    imported = import_log(path, content)
    model_file.write_text(model_file.read_text() + imported.bias_toml())
    bias = read_case_of_one_gear(model_file, with_bias=True).bias
    assert bias["torque_Nm"].share == 0.02 and bias["torque_Nm"].constant == 0.05
    sizes = {"slip-offset": bias["slip"].constant, "torque-gain": 0.02, "torque-offset": 0.05}
    assert checked_sensors(imported.bias) == pytest.approx(sizes, rel=1e-3)


@pytest.mark.parametrize(
    ("imu", "unit"),
    [
        ({"pitch": 15.0}, "deg"),
        ({"ax": SINE, "ay": 0.0, "az": COSINE}, "g"),
        # positive about the axis to the left is downhill
        ({"qx": 0.0, "qy": -2 * np.sin(SLOPE / 2), "qz": 0.0, "qw": 2 * np.cos(SLOPE / 2)}, ""),
    ],
    ids=["angle", "accelerations", "quaternion"],
)
def test_each_wheel_is_a_run_and_the_load_knows_the_slope(imu, unit, tmp_path):
    """Front wheels lose h sin(alpha) / L of the weight to the rear ones."""
    d = drive(np.random.default_rng(25), slips=(0.2,))
    columns = {"t": d.time, "v": d.ground, **{k: np.full(d.time.size, x) for k, x in imu.items()}}
    for name in ("fl", "rr"):
        columns[f"w_{name}"], columns[f"T_{name}"] = d.rim / RADIUS, d.torque
    path = write_csv(tmp_path / "drive.csv", columns)
    content = {
        "time": {"column": "t"},
        "wheel": {"radius": RADIUS},
        "vehicle": {
            "mass": "20 kg +- 0.1 kg", "wheels": 4, "wheelbase": 0.8, "behind_front": 0.3,
            "height": "0.25 m +- 0.02 m",
        },
        "slope": {"column": list(imu), "unit": unit},
        "ground_speed": {"column": "v"},
        "wheels": {
            name: {
                "axle": axle,
                "wheel_speed": {"column": f"w_{name}"},
                "torque": {"column": f"T_{name}"},
            }
            for name, axle in (("fl", "front"), ("rr", "rear"))
        },
    }  # fmt: skip
    table = import_log(path, content).table
    assert list(table["run"]) == ["drive_fl", "drive_rr"] and list(table["wheel"]) == ["fl", "rr"]
    weight = 20 * 9.80665
    front = weight * (0.5 * COSINE - 0.25 * SINE) / 0.8 / 2
    rear = weight * COSINE / 2 - front
    np.testing.assert_allclose(table["load_N"], [front, rear], rtol=1e-6)


def test_two_files_of_one_run_with_clocks_of_their_own(tmp_path):
    rng = np.random.default_rng(26)
    logs = []
    for k in range(2):
        d = drive(rng, slips=(0.1, 0.4), load=50 + 20 * k)
        motor = {"Time": 100 + d.time, "Wheel Speed (rad/s)": d.rim / RADIUS,
                 "Carriage Speed (m/s)": d.ground}  # fmt: skip
        logs.append(write_csv(tmp_path / f"run{k}_motor.csv", motor, ";", ","))
        time = np.arange(0.0, d.time[-1], 0.01)
        force = {"Timestamp": time, "Fz": np.interp(time, d.time, d.load),
                 "Ty": -np.interp(time, d.time, d.torque)}  # fmt: skip
        logs.append(write_csv(tmp_path / f"run{k}_ft.csv", force, "\t"))
    text = init_map(logs).replace('# radius = "0.15 m', 'radius = "0.15 m')
    (tmp_path / "map.toml").write_text(text)
    table = import_log(logs, tmp_path / "map.toml").table
    assert list(table["run"]) == ["run0", "run0", "run1", "run1"]
    np.testing.assert_allclose(table["slip"], [0.1, 0.4] * 2, atol=0.02)
    loads = np.array([50.0, 50.0, 70.0, 70.0])
    np.testing.assert_allclose(table["load_N"], loads, rtol=0.02)
    np.testing.assert_allclose(table["torque_Nm"], torque_law([0.1, 0.4] * 2, loads), rtol=0.08)


def test_a_run_in_reverse_is_positive_along_its_travel(tmp_path):
    d = drive(np.random.default_rng(27), slips=(0.3,))
    columns = {"t": d.time, "w": -d.rim / RADIUS, "v": -d.ground, "torque": -d.torque, "Fz": d.load}
    table = import_log(write_csv(tmp_path / "log.csv", columns), MAP | SPEEDS).table
    assert table["slip"][0] == pytest.approx(0.3, abs=0.02)
    assert table["torque_Nm"][0] == pytest.approx(torque_law(0.3), rel=0.06)
    assert table["speed_m_s"][0] < 0.0


def test_what_a_map_lacks_is_said(tmp_path):
    path, _ = log_of(np.random.default_rng(28), tmp_path / "log.csv", slips=(0.3,))
    for key, word in (("wheel", "radius"), ("load", "load"), ("wheel_speed", "rotation"),
                      ("ground_speed", "travel")):  # fmt: skip
        content = {k: v for k, v in (MAP | SPEEDS).items() if k != key}
        with pytest.raises(InputError, match=rf"{word}.* is missing"):
            import_log(path, content)
    with pytest.raises(InputError, match="did you mean 'torque'"):
        import_log(path, MAP | SPEEDS | {"torque": {"column": "torqe"}})
    with pytest.raises(InputError, match="unknown key 'ratio'"):
        import_log(path, MAP | SPEEDS | {"torque": {"column": "torque", "ratio": 2}})


def test_a_model_file_of_another_wheel_is_refused(tmp_path, model_file):
    """The table says at which radius slip is defined."""
    d = drive(np.random.default_rng(12), slips=(0.2, 0.4), seconds=8)
    columns = {"t": d.time, "omega": d.rim / 0.11, "v": d.ground, "torque": d.torque, "Fz": d.load}
    text = init_map(write_csv(tmp_path / "a.csv", columns))
    (tmp_path / "map.toml").write_text(text.replace('# radius = "0.15 m', 'radius = "0.11 m'))
    found = import_log(tmp_path / "a.csv", tmp_path / "map.toml")
    with pytest.raises(TableError, match=r"radius_m: 0\.11 given, the model's wheel has 0\.15"):
        identify(read_case(model_file), found.table, method="nonlinear")


def test_a_clock_of_huge_numbers_is_no_time(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,w,v,torque,Fz\n" + "".join(f"{i}e300,1,0.1,2,60\n" for i in range(40)))
    with pytest.raises(InputError, match="run a: no channel has two samples with a time"):
        import_log(path, MAP | SPEEDS)


def test_no_decision_depends_on_the_words_of_remarks(tmp_path, monkeypatch):
    path, _ = log_of(np.random.default_rng(5), tmp_path / "log.csv", slips=(0.1, 0.3, 0.5))

    def outcome():
        found = import_log(path, MAP | SPEEDS)
        stretches = [
            (s.start, s.stop, s.why and s.why.code) for one in found.series for s in one.stretches
        ]
        return csv_text(found.table.columns), stretches, [r.code for r in found.remarks]

    usual, initialise = outcome(), Remark.__init__

    def nonsense(remark, code, text, *others, **named):
        initialise(remark, code, "nonsense", *others, **named)

    monkeypatch.setattr(Remark, "__init__", nonsense)
    assert outcome() == usual
