"""Logs whose load, slip, units or slope stand elsewhere than in a column of their own."""

import numpy as np
from foreign_rigs import RADIUS_EDIT, drive, noisy, table, way

GRAVITY = 9.80665


def quantities_over_units(rng, folder):
    """Names as DIN 1313 writes them, a separator behind the last cell, Latin-1."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3)
    header = ("Zeit / s;Raddrehzahl / min^-1;Schlittenweg / mm;Drehmoment / N·m;"
              "Kraft vertikal / kN;Kraft horizontal / N;Einsinkung in cm;")  # fmt: skip
    rows = table((d.t, noisy(rng, d.omega * 30 / np.pi, 0.01),
                  noisy(rng, 1000 * way(d.t, d.v), 0.2), noisy(rng, d.torque, 0.03),
                  noisy(rng, d.load / 1000, 4e-4), noisy(rng, d.pull, 0.3), 100 * d.sinkage),
                 ";", decimal=",", digits=6)  # fmt: skip
    text = "\r\n".join([header, *(row + ";" for row in rows)])
    (folder / "messung.csv").write_bytes(text.encode("latin-1"))
    return [folder / "messung.csv"], [RADIUS_EDIT], d.stages


def dead_weights(rng, folder):
    """No sensor of load: the mass on the carriage stands in the names of the files."""
    logs, stages = [], []
    for mass in (4, 7):
        for k, slip in enumerate((0.1, 0.3)):
            d = drive(rng, (slip,), [mass * GRAVITY], seconds=20)
            logs.append(folder / f"W{mass:02d}kg_s{int(100 * slip)}_r{k + 1}.csv")
            rows = table((d.t, noisy(rng, np.rad2deg(d.omega), 0.1), noisy(rng, 100 * d.v, 0.02),
                          noisy(rng, 1000 * d.torque, 30)))  # fmt: skip
            header = "time(s),wheel_speed(deg/s),trolley_speed(cm/s),torque(mNm)"
            logs[-1].write_text("\n".join([header, *rows]))
            stages += d.stages
    return logs, [RADIUS_EDIT], stages


def a_quaternion(rng, folder):
    """A rover on a slope of 8 deg, as a topic was written to CSV; its heading is 30 deg."""
    slope, heading = np.deg2rad(8), np.deg2rad(30)
    d = drive(rng, (0.1, 0.25, 0.4), [6 * GRAVITY * np.cos(slope)] * 3, rate=50, speed=0.05)
    way_there, n = way(d.t, d.v), d.t.size
    # nose up is a turn about the left axis by -slope, and then the heading about the vertical
    a, b = -slope / 2, heading / 2
    turn = (-np.sin(b) * np.sin(a), np.cos(b) * np.sin(a), np.sin(b) * np.cos(a),
            np.cos(b) * np.cos(a))  # fmt: skip
    header = ("%time,field.wheel_velocity,field.effort,field.pose.position.x,"
              "field.pose.position.y,field.pose.position.z,field.orientation.x,"
              "field.orientation.y,field.orientation.z,field.orientation.w")  # fmt: skip
    level = way_there * np.cos(slope)
    rows = table((1e9 * (d.t + 1.7e9), d.omega, noisy(rng, d.torque, 0.05),
                  noisy(rng, level * np.cos(heading), 5e-4),
                  noisy(rng, level * np.sin(heading), 5e-4),
                  noisy(rng, way_there * np.sin(slope), 5e-4),
                  *(noisy(rng, np.full(n, part), 1e-3) for part in turn)), digits=6)  # fmt: skip
    (folder / "rover.csv").write_text("\n".join([header, *rows]))
    edits = [RADIUS_EDIT, ("# [vehicle]", "[vehicle]"), ('# mass = "6.1 kg', 'mass = "24 kg'),
             ("# wheels = 1", "wheels = 4")]  # fmt: skip
    return [folder / "rover.csv"], edits, d.stages


def per_cent_of_a_rated_torque(rng, folder):
    """The rated torque stands in the first line; the clock counts days, as spreadsheets do."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3)
    rows = table((45000.5 + d.t / 86400, d.omega * 30 / np.pi, noisy(rng, d.v, 2e-4),
                  noisy(rng, 100 * d.torque / 12, 0.3), noisy(rng, d.load, 0.3)),
                 digits=9)  # fmt: skip
    header = "Date/Time,Drive speed (rpm),Cart speed (m/s),Torque (% of rated),Load cell (N)"
    (folder / "x.csv").write_text("\n".join(["Rated torque: 12 Nm,,,,", header, *rows]))
    return [folder / "x.csv"], [RADIUS_EDIT], d.stages


def a_comment_with_the_header(rng, folder):
    """Samples between spaces; the names are in a comment, with their units in brackets."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3)
    rows = table((d.t, d.omega, noisy(rng, d.v, 2e-4), noisy(rng, d.torque, 0.03),
                  noisy(rng, d.load, 0.3), noisy(rng, d.pull, 0.3)), "  ")  # fmt: skip
    head = ["% single wheel testbed", "% t [s] w [rad/s] v [m/s] T [Nm] FN [N] DP [N]"]
    (folder / "out.dat").write_text("\n".join([*head, *rows]))
    return [folder / "out.dat"], [RADIUS_EDIT], d.stages


def codes_of_missing_readings(rng, folder):
    """-9999 where the torque or the load is missing, and a column of text."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3)
    torque, load = noisy(rng, d.torque, 0.03), noisy(rng, d.load, 0.4)
    for values in (torque, load):
        values[rng.random(values.size) < 0.02] = -9999.0
    rows = table((d.t, d.omega * 30 / np.pi, 1000 * way(d.t, d.v), torque, load))
    state = np.where(d.omega > 0.05, "RUN", "IDLE")
    rows = [row.replace(",", f",{word},", 1) for row, word in zip(rows, state, strict=True)]
    (folder / "s.csv").write_text("\n".join(["t [s],state,n [rpm],x [mm],T [Nm],Fz [N]", *rows]))
    return [folder / "s.csv"], [RADIUS_EDIT], d.stages


def slips_that_were_set(rng, folder):
    """Nothing turns or travels in the log; each file states its slip."""
    logs, stages = [], []
    for k, slip in enumerate((0.1, 0.3, 0.5)):
        d = drive(rng, (slip,), [60], seconds=20)
        logs.append(folder / f"exp{k + 1}.csv")
        rows = table((d.t, noisy(rng, d.torque, 0.03), noisy(rng, d.load, 0.4)))
        head = [f"Slip ratio: {slip}", "time [s],torque [Nm],Fz [N]"]
        logs[-1].write_text("\n".join([*head, *rows]))
        stages += d.stages
    return logs, [RADIUS_EDIT], stages


def a_lever(rng, folder):
    """The torque is a force on an arm of 0.2 m."""
    d = drive(rng, (0.1, 0.25, 0.4), [55] * 3)
    rows = table((d.t, d.omega * 30 / np.pi, noisy(rng, 1000 * d.v, 0.2),
                  noisy(rng, d.torque / 0.2, 0.2), noisy(rng, d.load, 0.4)))  # fmt: skip
    header = ("Time (s),Wheel speed (rpm),Carriage speed (mm/s),Torque arm force (N),"
              "Vertical load (N)")  # fmt: skip
    (folder / "l.csv").write_text("\n".join([header, *rows]))
    edits = [RADIUS_EDIT, ('# [torque]\n# column = "Torque arm force"\n# scale',
                           '[torque]\ncolumn = "Torque arm force"\nscale')]  # fmt: skip
    return [folder / "l.csv"], edits, d.stages


WRITERS = (quantities_over_units, dead_weights, a_quaternion, per_cent_of_a_rated_torque,
           a_comment_with_the_header, codes_of_missing_readings, slips_that_were_set,
           a_lever)  # fmt: skip
