"""A guess stands without a mark only with evidence, and what an import writes is read again."""

import numpy as np
import pytest
from foreign_rigs import RADIUS, drive, noisy
from guessed_channels import LOOKED_AT, RIGHT, SILENT, is_marked, judged_rigs, printed
from rig_tables import write

from soilml.cli import main
from soilml.log_import.units import unit_in_name
from soilml.optional_imports import tomllib

ROLES = ("wheel_speed", "wheel_angle", "rim_speed", "ground_speed", "position", "slip", "torque",
         "motor_current", "load", "drawbar_pull", "sinkage", "slope")  # fmt: skip
MODEL = """[gear]
type = "wheel"
radius = 0.13
width = 0.1
[soil]
name = "wong1989/dry_sand"
[soil.prior]
friction_angle = ["20 deg", "45 deg"]
[noise]
torque_Nm = "3 %"
"""
#: Columns that are no channel of a wheel, by names that share a letter or a word with one.
DECOYS = ("gyr_z", "quat_z", "temp_z", "vel_z", "rate_z", "acc_z", "velL", "field.velocity0",
          "CAN1_current", "adc_torque", "torque_raw", "cell_voltage", "motor_load", "cpu_load",
          "laser_intensity", "camera_depth", "yaw", "kappa", "effort", "height", "z", "h", "s",
          "x")  # fmt: skip


def init(folder, logs, *more):
    """The text of a new map, by the command."""
    out = folder / "map.toml"
    out.unlink(missing_ok=True)
    assert main(["import", "--init", *map(str, logs), "--out", str(out), *more]) == 0
    return out.read_text(encoding="utf-8")


def imported(folder, logs, text=None):
    """The rows of an import, by the command."""
    if text is not None:
        (folder / "map.toml").write_text(text, encoding="utf-8")
    words = ["import", *map(str, logs), "--map", str(folder / "map.toml")]
    return main([*words, "--out", str(folder / "runs.csv")])


def silent(text):
    """Columns of the channels of a map that no line marks, by role."""
    content = tomllib.loads(text)
    found = {r: content[r].get("column") for r in ROLES if r in content}
    return {r: c for r, c in found.items() if c and not is_marked(text, (r,))}


def log_of(folder, seed=5, **more):
    rng = np.random.default_rng(seed)
    d = drive(rng, (0.1, 0.3, 0.5), [60] * 3, rate=20)
    own = {"time [s]": d.t, "omega [rad/s]": d.omega, "v [m/s]": d.v}
    own |= {"torque [Nm]": noisy(rng, d.torque, 0.03), "Fz [N]": noisy(rng, d.load, 0.4)}
    return write(folder / "log.csv", own | {k: make(rng, d) for k, make in more.items()}), d


@pytest.mark.slow
def test_no_guess_over_all_rigs_is_wrong_without_a_mark():
    """Right or wrong, and marked or not: `python guessed_channels.py public_logs`."""
    kinds = [
        kind
        for module in ("described_rigs", "set_aside_rigs", "public_logs", "varied_rigs")
        for own in judged_rigs(module).values()
        for kind in own.values()
    ]
    assert kinds.count(SILENT) == 0
    assert kinds.count(RIGHT) + kinds.count(LOOKED_AT) > 0.9 * len(kinds)
    assert kinds.count(RIGHT) > 0.5 * len(kinds)


@pytest.mark.slow
@pytest.mark.parametrize("name", DECOYS)
def test_a_letter_or_a_size_is_no_evidence(name, tmp_path):
    for make in (
        lambda rng, d: rng.normal(0, 0.02, d.t.size),
        lambda rng, d: 800 + 300 * np.sin(d.t / 5),
        lambda rng, d: 3.1 * d.t,
    ):
        log, _ = log_of(tmp_path, **{name: make})
        assert name not in silent(init(tmp_path, [log])).values()


def test_a_clear_log_has_no_mark_and_its_evidence_is_printed(tmp_path, capsys):
    log, _ = log_of(tmp_path, gyr_z=lambda rng, d: rng.normal(0, 0.03, d.t.size))
    text = init(tmp_path, [log], "--explain")
    assert silent(text) == {"wheel_speed": "omega", "ground_speed": "v", "torque": "torque",
                            "load": "Fz"}  # fmt: skip
    said = capsys.readouterr().err
    assert "[ground_speed] v: no mark" in said and "travel over rotation is 0.12 m" in said
    assert "[sinkage]" not in said and "--init; give both" not in said
    assert main(["import", str(log), "--explain"]) == 2


@pytest.mark.parametrize(
    ("name", "make", "role", "why"),
    [
        ("water depth (cm)", lambda rng, d: rng.normal(30, 0.2, d.t.size), "sinkage", "its name"),
        ("torque B [Nm]", lambda rng, d: 1.3 * d.torque, "torque", "'torque B' fits as well"),
        ("motor torque [Nm]", lambda rng, d: 1.3 * d.torque, "torque", None),
    ],
)
def test_a_name_must_be_understood_and_be_the_only_one(name, make, role, why, tmp_path):
    log, _ = log_of(tmp_path, **{name: make})
    text = init(tmp_path, [log])
    assert (role in silent(text)) == (why is None)
    assert why is None or why in text
    assert name not in silent(text).values()


@pytest.mark.parametrize(("radius", "noise"), [(1.0, 0.0), (1.07, 0.0), (1.0, 0.003)])
def test_odometry_of_the_wheel_is_marked_whatever_its_radius(radius, noise, tmp_path, capsys):
    rng = np.random.default_rng(6)
    d = drive(rng, (0.02, 0.06, 0.12, 0.3), [60] * 4, rate=20)
    speed = radius * RADIUS * d.omega * (1.0 + noise * rng.standard_normal(d.t.size))
    log = write(tmp_path / "log.csv", {
        "time [s]": d.t, "omega [rad/s]": d.omega, "rover speed [m/s]": speed,
        "torque [Nm]": d.torque, "Fz [N]": d.load}, digits=6)  # fmt: skip
    text = init(tmp_path, [log])
    assert "computed from the rotation" in text
    text = text.replace("# radius = ", f'radius = "{RADIUS} m"  # ')
    refused = imported(tmp_path, [log], text)
    said = printed(capsys)
    assert refused == 2 if radius == 1.0 else "was the travel computed from the rotation" in said
    assert "divided by 100 twice" not in said


@pytest.mark.parametrize(
    "name", ["vel{0[0]}", "vel_{0}", "Left velocity", "v_{0}", "wheel_speed_{0} [m/s]"]
)
def test_speeds_of_two_sides_are_of_rims_and_no_travel(name, tmp_path):
    rng = np.random.default_rng(7)
    d = drive(rng, (0.1, 0.3), [60] * 2, rate=20)
    names = [name.replace("Left", side).format(side) for side in ("Left", "Right")]
    log = write(tmp_path / "log.csv", {
        "time [s]": d.t, names[0]: RADIUS * d.omega, names[1]: 1.02 * RADIUS * d.omega,
        "torque [Nm]": d.torque, "Fz [N]": d.load}, digits=6)  # fmt: skip
    text = init(tmp_path, [log])
    content = tomllib.loads(text)
    own = content.get("wheels", {}).get("left", content)["rim_speed"]
    assert own["column"] == names[0].removesuffix(" [m/s]") and is_marked(text, ("rim_speed",))
    assert "ground_speed" not in content and "NEEDED: no column is the travel" in text


def test_counts_of_a_converter_ask_for_the_calibration(tmp_path):
    log, _ = log_of(tmp_path)
    log.write_text(log.read_text().replace("torque [Nm]", "torque_adc"))
    text = init(tmp_path, [log])
    assert 'scale = "1 N m"  # CHANGE: what 1 count is' in text and "torque" not in silent(text)


def test_a_line_for_each_reading_of_a_bus(tmp_path):
    """Time, signal, value and unit, as exports of CAN have them."""
    d = drive(np.random.default_rng(8), (0.1, 0.3, 0.5), [60] * 3, rate=20)
    signals = {"WheelSpeed": ("rad/s", d.omega), "VehicleSpeed": ("km/h", 3.6 * d.v),
               "WheelTorque": ("Nm", d.torque), "WheelLoad": ("N", d.load)}  # fmt: skip
    lines = [f"{t:.3f},{name},{values[i]:.5f},{unit}" for i, t in enumerate(d.t)
             for name, (unit, values) in signals.items()]  # fmt: skip
    (tmp_path / "can.csv").write_text("\n".join(["Timestamp,Signal,Value,Unit", *lines]))
    text = init(tmp_path, [tmp_path / "can.csv"])
    assert silent(text) == {"wheel_speed": "WheelSpeed", "ground_speed": "VehicleSpeed",
                            "torque": "WheelTorque", "load": "WheelLoad"}  # fmt: skip


def test_a_load_far_from_the_stated_mass_is_marked(tmp_path):
    log, _ = log_of(tmp_path)
    log.write_text("# rover mass: 12 kg, 6 wheels\n" + log.read_text())
    assert "the mass of [vehicle] gives" in init(tmp_path, [log])


def test_windows_of_a_sensor_that_clips_are_without_it(tmp_path, capsys):
    log, _ = log_of(tmp_path)
    lines = log.read_text().splitlines()
    rows = np.array([line.split(",") for line in lines[1:]], dtype=float)
    rows[:, 3] = np.minimum(rows[:, 3], limit := float(np.quantile(rows[:, 3], 0.8)))
    log.write_text("\n".join([lines[0], *(",".join(f"{x:.5f}" for x in row) for row in rows)]))
    text = init(tmp_path, [log]).replace("# radius = ", f'radius = "{RADIUS} m"  # ')
    assert imported(tmp_path, [log], text) == 0
    assert f"[torque] reads {limit:.4g} in" in printed(capsys)
    rows = np.genfromtxt(tmp_path / "runs.csv", delimiter=",", names=True, encoding=None)
    assert np.isnan(rows["torque_Nm"][rows["slip"] > 0.45]).all()
    assert np.isfinite(rows["torque_Nm"][rows["slip"] < 0.2]).all()


def test_a_named_clock_that_jitters_beats_a_counter(tmp_path):
    log, d = log_of(tmp_path, seq=lambda rng, d: np.arange(d.t.size))
    text = log.read_text().replace("time [s]", "timestamp")
    jitter = np.random.default_rng(1).exponential(1.0, d.t.size).cumsum() * d.t[1]
    head, *lines = text.splitlines()
    rows = [f"{t:.4f},{line.split(',', 1)[1]}" for t, line in zip(jitter, lines, strict=True)]
    log.write_text("\n".join([head, *rows]))
    assert tomllib.loads(init(tmp_path, [log]))["time"]["column"] == "timestamp"


def test_a_slip_above_one_without_unit_is_no_per_cent(tmp_path):
    slip = np.array([0.05, 0.15, 0.3, 0.45, 0.6])
    columns = {"test": np.arange(5), "slip": slip / (1 - slip), "torque [Nm]": 40 * slip}
    log = write(tmp_path / "t.csv", columns | {"Fz [N]": np.full(5, 300.0)})
    text = init(tmp_path, [log])
    assert "slip" not in silent(text)
    assert imported(tmp_path, [log], text) == 0
    rows = np.genfromtxt(
        tmp_path / "runs.csv", delimiter=",", names=True, dtype=None, encoding=None
    )
    np.testing.assert_allclose(rows["slip"], slip, atol=1e-4)


def test_a_slip_that_was_set_is_identified_without_an_edit(tmp_path, capsys):
    rng = np.random.default_rng(2)
    t = np.arange(0, 12, 0.1)
    slip = np.where(t < 4, 0.2, np.where(t < 8, 0.4, 0.6))
    log = write(tmp_path / "log.csv", {
        "time [s]": t, "slip [-]": slip, "torque [Nm]": noisy(rng, 2 + 4 * slip, 0.05),
        "Fz [N]": noisy(rng, 60 + 0 * t, 0.5)})  # fmt: skip
    init(tmp_path, [log])
    assert imported(tmp_path, [log]) == 0
    assert "slip_std" not in (tmp_path / "runs.csv").read_text().splitlines()[0]
    (tmp_path / "model.toml").write_text(MODEL)
    capsys.readouterr()
    assert main(["identify", str(tmp_path / "model.toml"), str(tmp_path / "runs.csv")]) == 0


@pytest.mark.parametrize("same", [True, False])
def test_one_sensor_for_rotation_and_travel_gives_no_slip(same, tmp_path, capsys):
    rng = np.random.default_rng(3)
    t = np.arange(0, 60, 0.1)
    rim = noisy(rng, np.choose((t // 10).astype(int), [0.1, 0.2, 0.15, 0.25, 0.12, 0.22]), 1e-3)
    columns = {"time": t, "rim": rim, "odom": 1.002 * rim, "T": 3 + 0.02 * rng.normal(size=t.size)}
    log = write(tmp_path / "log.csv", columns, digits=6)
    travel = "rim" if same else "odom"
    text = f"""[time]
column = "time"
[wheel]
radius = 0.13
[rim_speed]
column = "rim"
[ground_speed]
column = "{travel}"
[torque]
column = "T"
[load]
value = 60
"""
    assert imported(tmp_path, [log], text) == 2
    assert "slip is" in (said := capsys.readouterr().err) and "by construction" in said
    assert not (tmp_path / "runs.csv").exists()


def test_rows_of_several_wheels_keep_their_sizes_and_are_refused(tmp_path, capsys):
    log = write(tmp_path / "t.csv", {
        "wheel_radius_m": [0.13, 0.13, 0.2, 0.2], "load_N": [60, 60, 90, 90],
        "slip": [0.1, 0.3, 0.1, 0.3], "torque_Nm": [1.3, 2, 3, 5]})  # fmt: skip
    text = init(tmp_path, [log])
    assert imported(tmp_path, [log], text) == 0
    assert "rows of several wheels" in printed(capsys)
    (tmp_path / "model.toml").write_text(MODEL)
    assert main(["identify", str(tmp_path / "model.toml"), str(tmp_path / "runs.csv")]) == 2
    assert "wheel_radius_m" in capsys.readouterr().err


def test_kinds_of_files_with_the_number_of_the_run(tmp_path, capsys):
    logs = []
    for k, slip in enumerate((0.1, 0.3), 1):
        d = drive(np.random.default_rng(k), (slip,), [60], rate=20)
        logs += [
            write(tmp_path / f"wheel{k}.csv", {"time": d.t, "wheel_speed [rad/s]": d.omega}),
            write(tmp_path / f"cart{k}.csv", {"time": d.t, "carriage_speed [m/s]": d.v}),
            write(tmp_path / f"ft{k}.csv", {"time": d.t, "wheel_torque [Nm]": d.torque,
                                            "wheel_load [N]": d.load}),
        ]  # fmt: skip
    text = init(tmp_path, logs).replace("# radius = ", f'radius = "{RADIUS} m"  # ')
    assert imported(tmp_path, logs, text) == 0
    rows = (tmp_path / "runs.csv").read_text().splitlines()[1:]
    assert {line.split(",")[0] for line in rows} == {"1", "2"}
    assert main(["import", "--init", *map(str, logs[:-1])]) == 2
    assert "run 2: no file of the kind 'ft'" in capsys.readouterr().err


def test_files_of_one_run_in_a_folder_each(tmp_path):
    logs = []
    for k, slip in enumerate((0.1, 0.3)):
        d = drive(np.random.default_rng(k), (slip,), [60], rate=20)
        folder = tmp_path / f"run_{k}"
        folder.mkdir()
        for name, columns in {
            "driver-wheel_unit": {"time": d.t, "wheel_speed [rad/s]": d.omega},
            "driver-travel_unit": {"time": d.t, "carriage_speed [m/s]": d.v},
            "ft_sensor-wheel_wrench": {"time": d.t, "wheel_torque [Nm]": d.torque,
                                       "wheel_load [N]": d.load},
        }.items():  # fmt: skip
            logs.append(write(folder / f"{name}.csv", columns))
    text = init(tmp_path, logs).replace("# radius = ", f'radius = "{RADIUS} m"  # ')
    assert imported(tmp_path, logs, text) == 0
    rows = (tmp_path / "runs.csv").read_text().splitlines()[1:]
    assert {line.split(",")[0] for line in rows} == {"run_0", "run_1"}


@pytest.mark.parametrize("clock", ["One", "No"])
def test_units_and_rate_of_a_labview_head(clock, tmp_path):
    d = drive(np.random.default_rng(4), (0.1, 0.3), [60] * 2, rate=20)
    units = ("N", "Nm", "rad/s", "mm/s")
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Multi_Headings\tNo",
            f"X_Columns\t{clock}", "***End_of_Header***\t", "\t", "Channels\t4",
            "Y_Unit_Label\t" + "\t".join(units), "X_Dimension\t" + "\t".join(["Time"] * 4),
            "Delta_X\t" + "\t".join([f"{d.t[1]:.6f}"] * 4), "***End_of_Header***",
            "X_Value\tRadlast\tDrehmoment\tRaddrehzahl\tFahrgeschwindigkeit\tComment"]  # fmt: skip
    times = [f"{t:.4f}" if clock == "One" else "" for t in d.t]
    rows = [f"{t}\t{a:.4f}\t{b:.4f}\t{c:.5f}\t{e:.4f}" for t, a, b, c, e in
            zip(times, d.load, d.torque, d.omega, 1000 * d.v, strict=True)]  # fmt: skip
    (tmp_path / "fahrt.lvm").write_text("\n".join([*head, *rows]))
    text = init(tmp_path, [tmp_path / "fahrt.lvm"])
    assert silent(text) == {"load": "Radlast", "torque": "Drehmoment",
                            "wheel_speed": "Raddrehzahl",
                            "ground_speed": "Fahrgeschwindigkeit"}  # fmt: skip
    content = tomllib.loads(text)
    assert content["ground_speed"]["unit"] == "mm/s"
    assert content["time"].get("rate", "20 Hz") == "20 Hz"


def test_what_was_computed_shares_its_error(tmp_path, capsys):
    """A torque that is a constant times a current, and a load that never changes."""
    log, _ = log_of(tmp_path, **{"current [A]": lambda rng, d: d.torque})
    lines = log.read_text().splitlines()
    rows = np.array([line.split(",") for line in lines[1:]], dtype=float)
    rows[:, 3], rows[:, 4] = 1.01 * rows[:, 5], 60.0
    log.write_text("\n".join([lines[0], *(",".join(f"{x:.5f}" for x in row) for row in rows)]))
    text = init(tmp_path, [log]).replace("# radius = ", f'radius = "{RADIUS} m"  # ')
    text = text.replace('bias = "1 %"', "")
    assert imported(tmp_path, [log], text) == 0
    said = printed(capsys)
    assert "[torque] is a constant times the current 'current'" in said
    assert "[load] is a constant or follows from the slope" in said
    bias = tomllib.loads((tmp_path / "runs.bias.toml").read_text())["bias"]
    assert bias["torque_Nm"] == "10 %" and bias["load_N"] == "2 %"


def test_units_at_the_end_of_names_and_a_distance_without_a_rest(tmp_path):
    d = drive(np.random.default_rng(3), (0.1, 0.3, 0.5), [60] * 3, rate=20)
    turns = d.omega > 0.05
    own = {"time_s": d.t, "omega_deg_per_sec": np.rad2deg(d.omega), "v_ft_s": d.v / 0.3048,
           "torque_N_m": d.torque, "total_load_lbf": d.load / 1.1,
           "laser_mm": 400.0 - 1e3 * d.sinkage}  # fmt: skip
    log = write(tmp_path / "log.csv", {name: values[turns] for name, values in own.items()})
    text = init(tmp_path, [log])
    found = tomllib.loads(text)
    units = {role: found[role]["unit"] for role in ("wheel_speed", "ground_speed", "torque")}
    assert units == {"wheel_speed": "deg/s", "ground_speed": "ft/s", "torque": "N_m"}
    assert silent(text).keys() == {"wheel_speed", "ground_speed"}
    assert "no rest shows where the surface is" in text and "its name is of a whole" in text


@pytest.mark.parametrize(
    "name, unit",
    [("time_in_s", "s"), ("v_m_per_s", "m/s"), ("gap in ft", "ft"), ("per", ""), ("Per-per", "")],
)
def test_the_unit_that_ends_a_name(name, unit):
    assert unit_in_name(name) == unit
