"""Logs that state calibrations and constants, whose wheels share columns, that know only slip."""

import datetime

import numpy as np
import pytest
from foreign_rigs import RADIUS, RADIUS_EDIT, drive, law, noisy, table
from simulated_rig import imported

from soilml.errors import InputError
from soilml.log_import import import_log, init_map
from soilml.log_import.guesses.constants import stated_constants

SLIPS = (0.1, 0.25, 0.45)


def check(rows, stages):
    """Each row is a stage, and each stage a row."""
    place = [int(np.argmin([abs(s - slip) / 0.05 + abs(w / load - 1) * 8 for s, w in stages]))
             for slip, load in zip(rows["slip"], rows["load_N"], strict=True)]  # fmt: skip
    assert {*place} == {*range(len(stages))}
    slips, loads = np.array(stages)[place].T
    torque, pull, _ = law(np.abs(slips), loads)
    np.testing.assert_allclose(rows["slip"], slips, atol=0.012)
    np.testing.assert_allclose(rows["load_N"], loads, rtol=0.04)
    np.testing.assert_allclose(rows["torque_Nm"], np.sign(slips) * torque, rtol=0.06)
    if "drawbar_pull_N" in rows:
        np.testing.assert_allclose(rows["drawbar_pull_N"], pull, atol=1.0)


def test_millivolts_and_a_carriage_speed_of_the_head(tmp_path):
    """Radius and speed of the carriage are stated; what 1 mV and 1 V are is asked for."""
    rng = np.random.default_rng(60)
    logs, stages = [], []
    for k, load in enumerate((45, 70)):
        d = drive(rng, SLIPS, [load] * 3, speed=0.02, cart=True)
        lines = ["# Wheel diameter: 260 mm", "# Carriage speed: 20 mm/s (constant)",
                 "# CH3 torque: 1 mV = 0.425 N m, excitation 5 V", "# CH4 load: 12.5 N/V",
                 "Time,nWheel,TorqueCh3,Load_Ch4,Drawbar", "s,rpm,mV,V,kgf"]  # fmt: skip
        lines += table((d.t, d.omega * 30 / np.pi, noisy(rng, d.torque / 0.425 + 1.37, 0.1),
                        d.load / 12.5, noisy(rng, d.pull / 9.80665, 0.03)))  # fmt: skip
        logs.append(tmp_path / f"test{k}.csv")
        logs[-1].write_text("\n".join(lines))
        stages += d.stages
    edits = [('scale = "1 N m"  # CHANGE: what 1 mV is', 'scale = "0.425 N m"  # '),
             ('scale = "1 N"  # CHANGE: what 1 V is', 'scale = "12.5 N"  # ')]  # fmt: skip
    found, text = imported(tmp_path, logs, edits)
    assert 'value = "20 mm/s +- 1 %"' in text
    check(found.table, stages)


@pytest.mark.parametrize("label", ["{}", "wheel {}"])
def test_a_line_for_each_wheel(label, tmp_path):
    """Wheels by an id, times with a zone, an irregular clock with lines that stand twice."""
    rng = np.random.default_rng(61)
    start = datetime.datetime.fromisoformat("2025-06-03T14:02:07+02:00")
    lines, stages = [], []
    for k, load in enumerate((40, 52, 68)):
        d = drive(rng, SLIPS, [load] * 3)
        clock = d.t + 0.01 * rng.random(d.t.size)
        for i in np.flatnonzero(rng.random(d.t.size) < 0.8):
            when = start + datetime.timedelta(seconds=float(clock[i]))
            shown = f"{d.omega[i]:.4f},{d.v[i]:.5f},{d.torque[i]:.4f},{d.load[i]:.3f}"
            line = f"{when.isoformat(timespec='milliseconds')},{label.format(k)},{shown}"
            lines += [(clock[i], line)] * (1 + (rng.random() < 0.04))
        stages += d.stages
    head = "timestamp,wheel_id,wheel_omega_rad_s,v_m_s,torque_Nm,Fz_N"
    path = tmp_path / "drive.csv"
    path.write_text("\n".join([head, *(line for _, line in sorted(lines))]))
    found, text = imported(tmp_path, path, [RADIUS_EDIT])
    assert 'column = "timestamp"' in text and 'column = "wheel_id"  # a line for each wheel' in text
    assert {*found.table["run"]} == {label.format(k) for k in range(3)}
    check(found.table, stages)


def test_slip_in_per_cent_that_counts_braking_up(tmp_path):
    """A force sensor of six axes and `i`, below zero where the wheel drives; nothing else."""
    rng = np.random.default_rng(63)
    d = drive(rng, (0.4, 0.25, 0.1), [60] * 3)
    still = noisy(rng, 0 * d.t, 0.3)
    braking = d.t > d.t[-1] - 2 - 12  # the last stage brakes by as much
    act = np.clip(d.omega * RADIUS / 0.03, 0, 1)
    slip = np.interp(d.t, [4, 4.4, 16, 16.4, 28, 28.4], [0, 0.4, 0.4, 0.25, 0.25, 0.1])
    sign = np.where(braking, -1.0, 1.0)
    lines = ["t;Fx;Fy;Fz;Mx;My;Mz;i;z", "[s];[N];[N];[N];[Nm];[Nm];[Nm];[%];[mm]"]
    lines += table((d.t, d.pull + 3.2, still, -d.load, 0.1 * still, -sign * d.torque, 0.1 * still,
                    -100 * sign * slip * (act > 0.1), 12.5 + 1000 * d.sinkage), ";")  # fmt: skip
    (tmp_path / "ft.csv").write_text("\n".join(lines))
    found, text = imported(tmp_path, tmp_path / "ft.csv")
    slip_table = text.partition("[slip]")[2].partition("[torque]")[0]
    assert 'column = "i"' in slip_table and "reverse = true" in slip_table
    assert "it reads 3.2 before the wheel starts" in text  # by the torque, as no speed is known
    assert "it reads 16.5 mm before the wheel starts" in text
    check(found.table, [(0.4, 60), (0.25, 60), (-0.1, 60)])


def test_stated_numbers_are_in_plain_digits(tmp_path):
    """Python's own `float` reads digits of other scripts, and hundreds of them as infinite."""
    assert "radius" in stated_constants(["radius: 150 mm"])
    assert not stated_constants(["radius: \uff11\uff15\uff10 mm"])
    assert not stated_constants([f"gear ratio: {'9' * 400}"])
    file = tmp_path / "load_\uff16\uff10N.csv"
    file.write_text("v,w,M\n" + "0.1,1,2\n" * 30, "utf-8")
    assert "file_name" not in init_map(file)
    given = {"time": {"rate": "10 Hz"}, "wheel": {"radius": RADIUS}}
    given |= {"wheel_speed": {"column": "w"}, "ground_speed": {"column": "v"}}
    given["load"] = {"file_name": r"load_(\d+)N"}
    with pytest.raises(InputError, match="finds no number in the name of the run"):
        import_log(file, given | {"torque": {"column": "M"}})
