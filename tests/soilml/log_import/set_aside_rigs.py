"""Logs of rigs written after published descriptions, set aside while the guesses were made."""

import numpy as np
from described_rigs import GRAVITY, RPM, Truth, sideways, write
from foreign_rigs import RADIUS, drive, law, noisy, way


def axle_sensor_on_x(rng, folder):
    """Six axes on the axle: x points down, the torque is about z; diameter in the name in cm."""
    d = drive(rng, (0.05, 0.2, 0.4), [110] * 3, rate=20)
    side = sideways(rng, d, 0.15)
    log = write(
        folder / "Wheel_D26cm_GR14_trial2.csv",
        {"Time(s)": d.t, "FTS Fx(N)": noisy(rng, d.load, 0.5), "FTS Fy(N)": noisy(rng, d.pull, 0.4),
         "FTS Fz(N)": noisy(rng, side, 0.4), "FTS Mx(Nm)": noisy(rng, 0.04 * side, 0.03),
         "FTS My(Nm)": noisy(rng, 0.14 * d.load, 0.05), "FTS Mz(Nm)": noisy(rng, d.torque, 0.03),
         "Encoder raw": np.round(way(d.t, d.omega) * 14 / 2 / np.pi * 2000),
         "Motor speed (rpm, before gearbox)": RPM * 14 * d.omega,
         "Cart position (mm)": 1000 * way(d.t, d.v), "Laser (mm)": 180 - 1000 * d.sinkage},
    )  # fmt: skip
    return [log], Truth(
        d, "rotation travel torque load pull sinkage", {"radius": RADIUS, "gear_ratio": 14}
    )


def planetary_bed(rng, folder):
    """Chinese institute, English symbols: F_N, F_DP, M_D, z, omega, v, units in a second row."""
    d = drive(rng, (0.1, 0.3, 0.5), [80] * 3)
    log = write(
        folder / "no12.txt",
        {"t": d.t, "omega": d.omega, "v": d.v, "F_N": noisy(rng, d.load, 0.4),
         "F_DP": noisy(rng, d.pull, 0.3), "F_S": sideways(rng, d),
         "M_D": noisy(rng, d.torque, 0.03),
         "M_R": 0.1 * d.load, "z": 1000 * d.sinkage},
        separator="\t", units=["s", "rad/s", "m/s", "N", "N", "N", "N.m", "N.m", "mm"],
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def metadata_beside(rng, folder):
    """A JSON file beside the log states the wheel; slip is set by the carriage."""
    d = drive(rng, (0.1, 0.3, 0.5), [70] * 3, cart=True)
    (folder / "metadata.json").write_text(
        '{\n  "wheel_radius_mm": 130,\n  "wheel_width_mm": 100,\n  "gear_ratio": 50,\n'
        '  "operator": "A"\n}\n'
    )
    log = write(
        folder / "T07.csv",
        {"timestamp_ms": 1000 * d.t, "drive_motor_rpm": RPM * 50 * d.omega,
         "carriage_velocity_mmps": 1000 * d.v, "normal_force_N": noisy(rng, d.load, 0.4),
         "tractive_force_N": noisy(rng, d.pull, 0.3),
         "wheel_torque_Nm": noisy(rng, d.torque, 0.03)},
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull", {"radius": RADIUS, "gear_ratio": 50})


def tyre_in_a_bin(rng, folder):
    """Agricultural soil bin: gross traction as a torque, net traction, dynamic load in kN."""
    d = drive(rng, (0.08, 0.2, 0.35), [900] * 3)
    log = write(
        folder / "bin_4.csv",
        {"Time [s]": d.t, "Dynamic load [kN]": noisy(rng, d.load / 1000, 2e-3),
         "Net traction [kN]": noisy(rng, d.pull / 1000, 2e-3),
         "Input torque [N·m]": noisy(rng, d.torque, 0.3), "Axle speed [rev/min]": RPM * d.omega,
         "Carrier speed [km/h]": 3.6 * d.v, "Rut depth [cm]": 100 * d.sinkage,
         "Inflation pressure [kPa]": 110 + 0 * d.t},
        digits=6,
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def ros_wrench(rng, folder):
    """Topics as columns of CSV: wrench of the wheel, joint state, pose from tracking."""
    d = drive(rng, (0.1, 0.3, 0.5), [60] * 3)
    log = write(
        folder / "bag_export.csv",
        {"%time": 1e9 * (1.7e9 + d.t), "ft_sensor.wrench.force.x": noisy(rng, -d.pull, 0.3),
         "ft_sensor.wrench.force.y": sideways(rng, d),
         "ft_sensor.wrench.force.z": noisy(rng, -d.load, 0.4),
         "ft_sensor.wrench.torque.x": 0.08 * d.load,
         "ft_sensor.wrench.torque.y": noisy(rng, -d.torque, 0.03),
         "ft_sensor.wrench.torque.z": noisy(rng, 0 * d.t, 0.03),
         "joint_states.velocity": d.omega, "joint_states.effort": 0.5 + 0 * d.t,
         "mocap.pose.position.x": way(d.t, d.v), "mocap.pose.position.y": 0.5 + 0 * d.t,
         "mocap.pose.position.z": 0.2 - d.sinkage},
        digits=6,
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull")


def torque_table(rng, folder):
    """A supplement: i, F_H, F_V, Q, delta z for each run; standard errors beside."""
    slip = np.linspace(0.05, 0.6, 10)
    d = drive(rng, (0.1,), [50])
    torque, pull, sinkage = law(slip, 50.0 + 0 * slip)
    d.t, d.omega, d.v = np.arange(10.0), np.ones(10), RADIUS * (1 - slip)
    d.load, d.torque, d.pull, d.sinkage = 50.0 + 0 * slip, torque, pull, sinkage
    log = write(
        folder / "table_s2.csv",
        {"Slip ratio i (-)": slip, "Drawbar pull F_H (N)": pull, "Vertical load F_V (N)": d.load,
         "Driving torque Q (N mm)": 1000 * torque, "Sinkage (mm)": 1000 * sinkage},
    )  # fmt: skip
    return [log], Truth(d, "slip torque load pull sinkage", every_row=True)


def spanish_symbols(rng, folder):
    """Spanish headers in capitals, unit in words, load negative."""
    d = drive(rng, (0.1, 0.3, 0.5), [60] * 3)
    log = write(
        folder / "prueba 9.csv",
        {"TIEMPO (segundos)": d.t, "VELOCIDAD RUEDA (grados/s)": np.degrees(d.omega),
         "VELOCIDAD CARRO (milimetros/s)": 1000 * d.v,
         "FUERZA VERTICAL (newton)": noisy(rng, -d.load, 0.3),
         "FUERZA HORIZONTAL (newton)": noisy(rng, d.pull, 0.3),
         "FUERZA LATERAL (newton)": sideways(rng, d, 0.25),
         "PAR MOTOR (newton metro)": noisy(rng, d.torque, 0.03)},
        separator=";", decimal=",",
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull")


def rocker_leg(rng, folder):
    """One leg of a rover on a gantry: velocity NED, dead load by file name, motor amps."""
    d = drive(rng, (0.1, 0.3, 0.5), [7 * GRAVITY] * 3, speed=0.06)
    log = write(
        folder / "leg_7kg_r130mm_run1.csv",
        {"t_s": d.t, "v_N": noisy(rng, d.v, 1e-3), "v_E": noisy(rng, 0 * d.v, 1e-3),
         "v_D": noisy(rng, 0 * d.v, 1e-3), "wheel_omega": d.omega,
         "I_mot": noisy(rng, d.torque / 6, 0.02), "V_mot": 24 + rng.normal(0, 0.05, d.t.size),
         "yaw_deg": 12 + rng.normal(0, 0.2, d.t.size)},
    )  # fmt: skip
    return [log], Truth(d, "rotation travel current load", {"radius": RADIUS})


def two_cells_and_idle(rng, folder):
    """S-beam cells left and right carry the wheel, a third one pulls; torque transducer in mV."""
    d = drive(rng, (0.1, 0.3, 0.5), [84] * 3)
    log = write(
        folder / "cells_run_4.csv",
        {"Elapsed time [s]": d.t, "Load cell vertical left [N]": noisy(rng, 0.45 * d.load, 0.2),
         "Load cell vertical right [N]": noisy(rng, 0.55 * d.load, 0.2),
         "Load cell horizontal [N]": noisy(rng, d.pull, 0.3),
         "Torque transducer [mV]": noisy(rng, d.torque / 0.425, 0.05),
         "Wheel encoder [deg]": np.degrees(way(d.t, d.omega)),
         "Belt speed [cm/s]": 100 * d.v, "Dial gauge [mm]": 1000 * d.sinkage},
        head=["Torque transducer: 1 mV = 0.425 N m", "wheel radius r = 130 mm"],
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage", {"radius": RADIUS})


def micro_rover_wheel(rng, folder):
    """A small wheel: mN, mN m, mm, deg/s; force plate axes called vertical, fore-aft, lateral."""
    d = drive(rng, (0.1, 0.3, 0.5), [9] * 3)
    log = write(
        folder / "micro.csv",
        {"time/s": d.t, "vertical/mN": noisy(rng, 1000 * d.load, 30),
         "fore-aft/mN": noisy(rng, 1000 * d.pull, 300), "lateral/mN": 1000 * sideways(rng, d),
         "torque/mNm": noisy(rng, 1000 * d.torque, 5), "rotation/(deg/s)": np.degrees(d.omega),
         "stage/(mm/s)": 1000 * d.v, "sinkage/mm": 1000 * d.sinkage},
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def slip_logged_only(rng, folder):
    """Slip in per cent, thrust, normal reaction and power; speeds are of the carriage alone."""
    d = drive(rng, (0.1, 0.3, 0.5), [66] * 3)
    slip = np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0.0)
    log = write(
        folder / "test 3 (66 N).csv",
        {"Sample": np.arange(d.t.size), "Time_s": d.t, "Slip_pct": 100 * slip,
         "Normal_reaction_N": noisy(rng, d.load, 0.4), "Thrust_N": noisy(rng, d.pull, 0.3),
         "Shaft_torque_Nm": noisy(rng, d.torque, 0.03), "Power_W": d.torque * d.omega,
         "Subsidence_mm": 1000 * d.sinkage},
        digits=5,
    )  # fmt: skip
    return [log], Truth(d, "slip torque load pull sinkage")


def capitals_and_axes(rng, folder):
    """Vertical axis is Y: FY is the load, FX the pull, TZ the torque, POS_X, POS_Y; no units."""
    d = drive(rng, (0.1, 0.3, 0.5), [120] * 3)
    log = write(
        folder / "LOG0042_R130mm.TXT",
        {"TIME": d.t, "POS_X": 1000 * way(d.t, d.v), "POS_Y": -1000 * d.sinkage,
         "FX": noisy(rng, d.pull, 0.4), "FY": noisy(rng, d.load, 0.5),
         "FZ": noisy(rng, sideways(rng, d), 0.3), "TX": noisy(rng, 0.09 * d.load, 0.05),
         "TY": noisy(rng, 0 * d.t, 0.05), "TZ": noisy(rng, d.torque, 0.03),
         "RPM": RPM * d.omega},
        separator="\t",
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage", {"radius": RADIUS})


WRITERS = (axle_sensor_on_x, planetary_bed, metadata_beside, tyre_in_a_bin, ros_wrench,
           torque_table, spanish_symbols, rocker_leg, two_cells_and_idle, micro_rover_wheel,
           slip_logged_only, capitals_and_axes)  # fmt: skip
