"""Logs of test rigs as their software writes them, from a wheel model of their own.

Each writer returns the files, the edits that the map needs, and the true stages.
"""

import datetime
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

RADIUS = 0.13
RADIUS_EDIT = ('# radius = "0.15 m', f'radius = "{RADIUS} m')


def law(slip, load):
    """Torque, pull and sinkage of a wheel: a law as good as any."""
    torque = RADIUS * load * (0.06 + 0.62 * (1 - np.exp(-slip / 0.11)) * (1 + 0.15 * slip))
    pull = 0.93 * torque / RADIUS - 0.13 * load * (1 + 0.4 * slip)
    return torque, pull, 0.008 * (load / 50) ** 0.8 * (1 + 1.7 * slip)


@dataclass
class Samples:
    """What happened (n,), in SI units, and the true stages (slip, load)."""

    t: np.ndarray
    load: np.ndarray
    omega: np.ndarray
    v: np.ndarray
    torque: np.ndarray
    pull: np.ndarray
    sinkage: np.ndarray
    stages: list


def wander(rng, n, step, std, memory):
    keep = np.exp(-step / memory)
    return lfilter([1], [1, -keep], std * np.sqrt(1 - keep**2) * rng.standard_normal(n))


def drive(rng, slips, loads, rest=4.0, seconds=12.0, rate=25.0, speed=0.03, end=2.0, cart=False):
    """One slip after another; with `cart` the carriage keeps its speed and the wheel turns faster.

    The wheel rests before and after.
    """
    step = 1 / rate
    n = int((rest + seconds * len(slips) + end) * rate)
    t = step * np.arange(n)
    stage = np.floor((t - rest) / seconds).astype(int)
    on = (stage >= 0) & (stage < len(slips))
    stage = np.clip(stage, 0, len(slips) - 1)

    def lagged(values, time):
        return lfilter([1 - np.exp(-step / time)], [1, -np.exp(-step / time)], values)

    slip = lagged(np.where(on, np.asarray(slips)[stage], 0.0), 0.25)
    loads = np.asarray(loads, float)
    load = loads[0] + lagged(loads[stage] - loads[0], 0.4)
    act = lagged(on.astype(float), 0.1)
    rim = speed * act / (1 - slip) if cart else speed * act
    v = speed * act if cart else rim * (1 - slip)
    torque, pull, sinkage = law(slip, load)
    return Samples(
        t,
        load * (1 + wander(rng, n, step, 0.02, 0.4)),
        rim / RADIUS * (1 + wander(rng, n, step, 0.006, 0.2)),
        v * (1 + wander(rng, n, step, 0.01, 0.2)),
        torque * act * (1 + wander(rng, n, step, 0.03, 0.3)),
        act * (pull + wander(rng, n, step, 0.6, 0.3)),
        sinkage * act + 0.004 * (1 - act),
        list(zip(slips, loads, strict=True)),
    )


def noisy(rng, values, std):
    return values + std * rng.standard_normal(values.size)


def way(t, speed):
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])


def text(value, decimal=".", thousands="", digits=4):
    shown = f"{value:,.{digits}f}" if thousands else f"{value:.{digits}f}"
    return shown.replace(",", "\0").replace(".", decimal).replace("\0", thousands)


def table(columns, separator=",", **style):
    return [separator.join(text(x, **style) for x in row)
            for row in zip(*columns, strict=True)]  # fmt: skip


def nearest_stage(stages, slip, load):
    """The true stage (slip, load) that a row of an import is of."""
    return min(stages, key=lambda s: abs(s[0] - slip) / 0.05 + abs(s[1] / load - 1) * 8)


def runs_below_each_other(rng, folder):
    """TSV with a byte order mark: three runs, each with its header; the carriage stalls twice."""
    lines, stages = [], []
    for load in (40, 55, 75):
        d = drive(rng, (0.1, 0.25, 0.45), [load] * 3, speed=0.02, cart=True)
        v = np.where((np.abs(d.t - 9.7) < 0.7) | (np.abs(d.t - 35.7) < 0.7), 0.0, d.v)
        lines += [f"Run with {load} N", "Time (s)\tWheel speed (rpm)\tCarriage speed (mm/s)\t"
                  "Torque (N·cm)\tNormal force (N)\tTraction force (N)"]  # fmt: skip
        lines += table((d.t, noisy(rng, d.omega * 30 / np.pi, 0.01), noisy(rng, 1000 * v, 0.2),
                        noisy(rng, 100 * d.torque, 3), noisy(rng, d.load, 0.4),
                        noisy(rng, d.pull, 0.3)), "\t")  # fmt: skip
        lines += ["", ""]
        stages += d.stages
    log = folder / "all.tsv"
    log.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(lines).encode())
    return [log], [RADIUS_EDIT], stages


def a_file_per_wheel(rng, folder):
    """A rover whose wheels log apart, torque in per cent of the rated 20 N m."""
    logs, stages = [], []
    for wheel, load in (("FL", 45), ("RR", 69)):
        d = drive(rng, (0.1, 0.3, 0.5), [load] * 3)
        logs.append(folder / f"drive1_{wheel}.csv")
        rows = table((1000 * d.t, np.rad2deg(way(d.t, d.omega)), noisy(rng, d.v, 2e-4),
                      noisy(rng, 5 * d.torque, 0.3), noisy(rng, d.load, 0.3)))  # fmt: skip
        logs[-1].write_text("\n".join(["t_ms,wheel_angle_deg,v_mps,torque_pct,Fz_N", *rows]))
        stages += d.stages
    return logs, [RADIUS_EDIT, ('"0.01 N m"', '"0.2 N m"')], stages


def spanish(rng, folder):
    """Dates with decimal commas, a row of units, hard spaces between thousands, Windows-1252."""
    d = drive(rng, (0.08, 0.2, 0.35), [55] * 3)
    start = datetime.datetime(2024, 3, 5, 10, 59, 50)
    lines = ["Ensayo de rueda", "Operador;J. Pérez", "", "Fecha y hora;Velocidad de rueda;"
             "Velocidad del carro;Par motor;Carga vertical;Fuerza de tiro;Hundimiento",
             ";rpm;mm/s;N·mm;N;N;mm"]  # fmt: skip
    rows = table((d.omega * 30 / np.pi, noisy(rng, 1000 * d.v, 0.2),
                  noisy(rng, 1000 * d.torque, 30), d.load, noisy(rng, d.pull, 0.3),
                  1000 * d.sinkage), ";", decimal=",",
                 thousands="\xa0", digits=3)  # fmt: skip
    for t, row in zip(d.t, rows, strict=True):
        now = start + datetime.timedelta(seconds=float(t))
        lines.append(f"{now.strftime('%d/%m/%Y %H:%M:%S,%f')[:-3]};{row}")
    (folder / "ensayo.csv").write_bytes("\r\n".join(lines).encode("cp1252"))
    return [folder / "ensayo.csv"], [RADIUS_EDIT], d.stages


def a_rover_uphill(rng, folder):
    """A counter that starts again, ripple in a turned current, IMU in g, sparse odometry."""
    slope = np.deg2rad(6)
    load = 6 * 9.80665 * np.cos(slope)
    d = drive(rng, (0.1, 0.25, 0.4), [load] * 3, rate=50, speed=0.05)
    n, driving = d.t.size, d.omega > 0.05
    counter = (np.floor(way(d.t, d.omega) / 2 / np.pi * 53 * 2000) + 61000) % 65536
    ripple = 0.25 * np.sign(np.sin(2 * np.pi * 7.3 * d.t))
    current = -(d.torque / (53 * 0.0385 * 0.8) + driving * (0.1 + ripple))
    shown = rng.random(n) < 0.1
    rows = table((1e6 * (d.t + 1.7e9), counter, noisy(rng, current, 0.02),
                  noisy(rng, np.full(n, np.sin(slope)), 0.01), noisy(rng, np.zeros(n), 0.01),
                  noisy(rng, np.full(n, np.cos(slope)), 0.01)))  # fmt: skip
    odometry = noisy(rng, way(d.t, d.v), 5e-4)
    lines = [f"{row},{text(x, digits=5) if there else ''}"
             for row, x, there in zip(rows, odometry, shown, strict=True)]  # fmt: skip
    header = "stamp_us,mot_enc,mot_cur_A,imu_ax_g,imu_ay_g,imu_az_g,vo_x_m"
    (folder / "rover.csv").write_text("\n".join([header, *lines]))
    edits = [RADIUS_EDIT, ("counts_per_turn = 1", "counts_per_turn = 2000"),
             ("gear_ratio = 1 ", "gear_ratio = 53 "), ('"1.0 N m/A +- 5 %"', '"38.5 mN m/A"'),
             ('"0.7 +- 0.05"', "0.8"), ('"0 A +- 0.02 A"', '"0.1 A"'),
             ("# [vehicle]", "[vehicle]"), ('# mass = "6.1 kg', 'mass = "24 kg'),
             ("# wheels = 1", "wheels = 4")]  # fmt: skip
    return [folder / "rover.csv"], edits, d.stages


def four_cells_and_two_lasers(rng, folder):
    """Lifted for 30 s, then lowered, and lifted at the end; nothing is tared."""
    d = drive(rng, (0.12, 0.35, 0.12, 0.35), [50, 50, 80, 80], rest=36, rate=20, end=10)
    down = (d.t > 31) & (d.t < d.t[-1] - 6)
    load, sinkage = np.where(down, d.load, 0.0), np.where(down, d.sinkage, -0.03)
    columns = {"Elapsed [s]": d.t, "Wheel omega [deg/s]": np.rad2deg(d.omega),
               "Cart [cm/s]": noisy(rng, 100 * d.v, 0.03),
               "Torque cell [Nm]": noisy(rng, d.torque + 0.35, 0.03)}  # fmt: skip
    for k, (share, zero) in enumerate(((0.2, 1.3), (0.3, -0.4), (0.22, 2.1), (0.28, 0.7))):
        columns[f"LC{k + 1} [kg]"] = noisy(rng, load * share / 9.80665 + zero, 0.02)
    columns["Laser front [mm]"] = noisy(rng, 212.4 - 1000 * sinkage, 0.2)
    columns["Laser rear [mm]"] = noisy(rng, 207.9 - 1000 * sinkage, 0.2)
    (folder / "cells.csv").write_text("\n".join([";".join(columns), *table(columns.values(), ";")]))
    return [folder / "cells.csv"], [RADIUS_EDIT], d.stages


def chinese(rng, folder):
    """GB 18030 without a mark, runs by a column."""
    lines, stages = ["试验编号,时间(s),车轮转速(r/min),小车速度(mm/s),驱动扭矩(N·m),法向载荷(N),"
                     "挂钩牵引力(N),沉陷量(mm)"], []  # fmt: skip
    for k, load in enumerate((40, 60)):
        d = drive(rng, (0.1, 0.3, 0.5), [load] * 3)
        lines += table((np.full(d.t.size, k + 1), d.t, d.omega * 30 / np.pi,
                        noisy(rng, 1000 * d.v, 0.2), noisy(rng, d.torque, 0.03), d.load,
                        noisy(rng, d.pull, 0.3), 1000 * d.sinkage))  # fmt: skip
        stages += d.stages
    (folder / "shuju.csv").write_bytes("\n".join(lines).encode("gb18030"))
    return [folder / "shuju.csv"], [RADIUS_EDIT], stages


def a_line_per_reading(rng, folder):
    """A bus logger: time, name of the signal, value, as they come."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3, rate=100)
    readings = []
    for name, values, rate in (
        ("WheelSpeed_rpm", d.omega * 30 / np.pi, 20), ("CarriageSpeed_mm_s", 1000 * d.v, 10),
        ("Torque_Nm", d.torque, 25), ("NormalForce_N", d.load, 12),
    ):  # fmt: skip
        for i in np.flatnonzero(rng.random(d.t.size) < rate / 100):
            readings.append((d.t[i], name, values[i]))
    lines = [f"{1.7e9 + t:.4f},{name},{value:.5f}" for t, name, value in sorted(readings)]
    (folder / "bus.csv").write_text("\n".join(["timestamp,signal,value", *lines]))
    return [folder / "bus.csv"], [RADIUS_EDIT], d.stages


def a_spreadsheet_export(rng, folder):
    """Titles, three lines of header, apostrophes between thousands, times of day, means."""
    d = drive(rng, (0.1, 0.3, 0.5), [55] * 3, speed=0.04)
    empty = ";" * 6
    lines = ["Prüfstand Einzelrad" + empty, "Raddurchmesser 260 mm" + empty, empty,
             "Zeit;n_Rad;v_Wagen;M_Antrieb;F_Normal;F_Zug;z_Rad",
             "Messzeit;Drehzahl des Rades;Geschwindigkeit des Wagens;Drehmoment am Rad;Radlast;"
             "Zugkraft;Einsinkung", "hh:mm:ss,ms;1/min;mm/min;Ncm;N;N;mm"]  # fmt: skip
    rows = table((d.omega * 30 / np.pi, noisy(rng, 60000 * d.v, 10), noisy(rng, 100 * d.torque, 2),
                  d.load, noisy(rng, d.pull, 0.3), 1000 * d.sinkage), ";", decimal=",",
                 thousands="'", digits=3)  # fmt: skip
    for t, row in zip(d.t + 53980.0, rows, strict=True):
        clock = f"{int(t // 3600):02d}:{int(t % 3600 // 60):02d}:{t % 60:06.3f}"
        lines.append(f"{clock.replace('.', ',')};{row}")
    lines += [empty, "Mittelwert;1,0;2,0;3,0;4,0;5,0;6,0", "Ende der Messung"]
    (folder / "blatt.csv").write_bytes("\r\n".join(lines).encode("cp1252"))
    return [folder / "blatt.csv"], [], d.stages


def pounds_and_a_lifted_end(rng, folder):
    """Runs by a name, load in lb with an offset that shows when the wheel is lifted at the end."""
    lines = ["# bench v3", "Test,Time [sec],Slip set [%],Wheel rate [rad/s],Cart velocity [m/s],"
             "Torque [kgf-cm],Normal load [lb]"]  # fmt: skip
    stages, start = [], 0.0
    for load in (50, 80):
        d = drive(rng, (0.15, 0.4), [load] * 2, rest=5, end=6)
        lift = d.t > d.t[-1] - 4
        rows = table((start + d.t, np.zeros(d.t.size), np.where(lift, 0.2, d.omega),
                      noisy(rng, d.v, 3e-4), (d.torque + 0.2) / 0.0980665,
                      (np.where(lift, 0.0, d.load) + 2.0) / 4.4482216))  # fmt: skip
        lines += [f'"sand {load} N",{row}' for row in rows]
        start += d.t[-1] + 40
        stages += d.stages
    (folder / "bench.csv").write_text("\n".join([*lines, "# end"]))
    return [folder / "bench.csv"], [RADIUS_EDIT], stages


WRITERS = (runs_below_each_other, a_file_per_wheel, spanish, a_rover_uphill,
           four_cells_and_two_lasers, chinese, a_line_per_reading, a_spreadsheet_export,
           pounds_and_a_lifted_end)  # fmt: skip
