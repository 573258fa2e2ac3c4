"""Ten more kinds of public logs, written after the headers that their sources publish.

Samples are those of `drive`; nothing of the sources but the names of their columns is here.
"""

import numpy as np
from foreign_rigs import RADIUS, drive, noisy, way
from rig_tables import RPM, Truth, write


def steps(rng, **more):
    return drive(rng, (0.1, 0.25, 0.45), [60] * 3, rate=20, **more)


def vesc_tool(rng, folder):
    """Motor controller VESC, log of VESC Tool: electrical rpm, current, one speed of its own."""
    d = steps(rng)
    n, poles, gear = d.t.size, 7, 20
    names = [
        *("ms_today", "input_voltage", "temp_mos_max", "temp_motor", "current_motor", "current_in"),
        *("d_axis_current", "q_axis_current", "erpm", "duty_cycle", "amp_hours_used"),
        *("tachometer", "fault_code", "vesc_id", "speed_meters_per_sec", "num_vescs"),
        *("roll", "pitch", "yaw", "accX", "accY", "accZ"),
    ]
    known = {
        "ms_today": 1000 * d.t + 4e7, "input_voltage": noisy(rng, 36 + 0 * d.t, 0.1),
        "current_motor": d.torque / 3, "current_in": d.torque / 9, "q_axis_current": d.torque / 3,
        "erpm": d.omega * RPM * poles * gear, "tachometer": way(d.t, d.omega) * poles * gear,
        "speed_meters_per_sec": d.omega * RADIUS, "accZ": noisy(rng, 1 + 0 * d.t, 0.01),
    }  # fmt: skip
    columns = {name: known.get(name, noisy(rng, np.zeros(n), 0.01)) for name in names}
    return [write(folder / "vesc.csv", columns, separator=";")], Truth(d, "current")


def tyre_test_consortium(rng, folder):
    """Formula SAE tire test: names of two letters, a row of units, SR is (r omega - v)/v."""
    d = steps(rng, speed=3.0)
    slip = np.where(d.v > 0.05, RADIUS * d.omega / np.maximum(d.v, 1e-9) - 1, 0.0)
    columns = {
        "ET": d.t, "V": 3.6 * d.v, "N": d.omega * RPM, "SA": noisy(rng, 0 * d.t, 0.02),
        "IA": noisy(rng, 0 * d.t, 0.01), "RL": noisy(rng, 13 + 0 * d.t, 0.05),
        "RE": noisy(rng, 13 + 0 * d.t, 0.05), "P": noisy(rng, 84 + 0 * d.t, 0.3),
        "FX": d.pull, "FY": noisy(rng, 0 * d.t, 2), "FZ": -d.load, "MX": noisy(rng, 0 * d.t, 0.3),
        "MZ": noisy(rng, 0 * d.t, 0.2), "SR": slip, "TSTC": noisy(rng, 40 + 0 * d.t, 0.5),
    }  # fmt: skip
    units = ["sec", "kph", "rpm", "deg", "deg", "cm", "cm", "kPa", "N", "N", "N", "Nm", "Nm"]
    units += ["none", "degC"]
    log = write(folder / "B1654run21.dat", columns, separator="\t", units=units)
    return [log], Truth(d, "rotation travel load pull")


def rostopic_wrench(rng, folder):
    """`rostopic echo -p` of three topics, a file each, with times in ns."""
    d = steps(rng)
    clock = np.round(1e9 * (d.t + 1.6e9), -3)
    head = {"%time": clock, "field.header.seq": np.arange(d.t.size), "field.header.stamp": clock}
    wrench = {"field.wrench.force.x": d.pull, "field.wrench.force.y": noisy(rng, 0 * d.t, 0.5),
              "field.wrench.force.z": d.load, "field.wrench.torque.x": noisy(rng, 0 * d.t, 0.05),
              "field.wrench.torque.y": d.torque,
              "field.wrench.torque.z": noisy(rng, 0 * d.t, 0.05)}  # fmt: skip
    joints = {"field.position0": way(d.t, d.omega), "field.velocity0": d.omega}
    twist = {"field.twist.twist.linear.x": noisy(rng, d.v, 2e-4)}
    parts = {"wrench": wrench, "wheel_joint_states": joints, "mocap_twist": twist}
    logs = [write(folder / f"trial1_{k}.csv", head | own) for k, own in parts.items()]
    return logs, Truth(d, "rotation travel torque load pull")


def cube_rover(rng, folder):
    """Rover mobility in a lunar analogue: four wheels by number, raw currents, places by camera."""
    d = steps(rng, speed=0.05)
    columns = {"time_s": d.t, "pos_x": way(d.t, d.v), "pos_y": noisy(rng, 0 * d.t, 1e-3),
               "pos_z": noisy(rng, 0.1 + 0 * d.t, 1e-3)}  # fmt: skip
    columns |= {f"quat_{k}": noisy(rng, (k == "w") + 0 * d.t, 1e-3) for k in "xyzw"}
    columns |= {f"ang_vel_{k}": noisy(rng, 0 * d.t, 0.01) for k in "xyz"}
    columns |= {f"lin_acc_{k}": noisy(rng, 9.81 * (k == "z") + 0 * d.t, 0.05) for k in "xyz"}
    for k in range(1, 5):
        columns[f"enc{k}_rad"] = way(d.t, d.omega)
        columns[f"vel{k}_rad_s"] = noisy(rng, d.omega, 1e-3)
        columns[f"current{k}"] = np.round(512 + 40 * d.torque)
    return [write(folder / "Processed_Data.csv", columns)], Truth(d, "rotation travel")


def ardupilot_wheel_encoders(rng, folder):
    """ArduPilot Rover, message WENC as CSV: travel at the rim of two wheels, no other travel."""
    d = steps(rng)
    rim = way(d.t, d.omega) * RADIUS
    columns = {"TimeUS": 1e6 * d.t + 3e8, "Dist0": rim, "Qual0": 100 + 0 * d.t,
               "RPM0": d.omega * RPM, "Dist1": rim, "Qual1": 100 + 0 * d.t,
               "RPM1": d.omega * RPM}  # fmt: skip
    return [write(folder / "WENC.csv", columns)], Truth(d, "rotation")


def odometry_paths(rng, folder):
    """A course on localisation: path lengths of the two wheels, which are no travel."""
    d = steps(rng)
    rim = way(d.t, d.omega) * RADIUS
    log = write(folder / "odom.csv", {"Time": d.t, "s_right": rim, "s_left": rim + 1e-4 * d.t})
    return [log], Truth(d, "")


def inches_per_second(rng, folder):
    """Telemetry in inches: places in brackets, wheel speeds `v_l(ips)`, a mark as a number."""
    d = steps(rng)
    inch = 1 / 0.0254
    columns = {"v=1": 1 + 0 * d.t, "t_ms": 1000 * d.t, "x(in)": inch * way(d.t, d.v),
               "y(in)": noisy(rng, 0 * d.t, 0.02), "theta(deg)": noisy(rng, 0 * d.t, 0.2),
               "v_l(ips)": inch * RADIUS * d.omega, "v_r(ips)": inch * RADIUS * d.omega,
               "batt_V": noisy(rng, 12 + 0 * d.t, 0.02), "mark": 0 * d.t}  # fmt: skip
    return [write(folder / "run_0412_101500.csv", columns)], Truth(d, "travel")


def hub_motor_ramp(rng, folder):
    """Hub of a school robot: power, current and encoder of a motor, without any unit."""
    d = steps(rng)
    columns = {"time": d.t, "m_power": noisy(rng, 0.5 + 0 * d.t, 0.01),
               "batt_voltage": noisy(rng, 12 + 0 * d.t, 0.02), "motor_current": d.torque / 2,
               "motor_position": np.round(way(d.t, d.omega) * 537.7 / 6.2832),
               "motor_velocity": d.omega * 537.7 / 6.2832,
               "motor_acceleration": noisy(rng, 0 * d.t, 3)}  # fmt: skip
    return [write(folder / "output.csv", columns)], Truth(d, "current")


def discrete_elements(rng, folder):
    """Wheel in YADE, `saveDataTxt`: a comment as header, tabs, a slip ratio of its own."""
    d = steps(rng)
    slip = np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0.0)
    columns = {"# i": 1000.0 * np.arange(d.t.size), "t": d.t, "wheel_x_disp": way(d.t, d.v),
               "wheel_y_disp": noisy(rng, 0 * d.t, 1e-5), "wheel_z_disp": -d.sinkage,
               "wheel_obtained_lin_vel": d.v, "wheel_obtained_ang_vel": d.omega,
               "wheel_obtained_slip_ratio": slip, "wheel_net_torque": d.torque,
               "wheel_drawbar_pull": d.pull, "lin_vel_error": noisy(rng, 0 * d.t, 1e-3),
               "ang_vel_error": noisy(rng, 0 * d.t, 1e-3)}  # fmt: skip
    log = write(folder / "SWI_ServoPIDController", columns, separator="\t")
    return [log], Truth(d, "rotation travel torque pull")


def design_of_wheels(rng, folder):
    """Chrono through Python: soil and wheel repeated on each line, a displacement, no rotation."""
    d = steps(rng)
    columns = {"time": d.t, "wheel_label": 3 + 0 * d.t, "radius": RADIUS + 0 * d.t,
               "width": 0.1 + 0 * d.t, "mass": 6.1 + 0 * d.t, "lug_height": 0.01 + 0 * d.t,
               "lug_count": 24 + 0 * d.t, "displacement": way(d.t, d.v), "drawbar_pull": d.pull,
               "normal_force": d.load, "sinkage": d.sinkage, "soil_Kphi": 2e6 + 0 * d.t,
               "soil_n": 1.1 + 0 * d.t, "soil_cohesion": 500 + 0 * d.t,
               "soil_friction": 30 + 0 * d.t}  # fmt: skip
    log = write(folder / "wheel_3.csv", columns)
    return [log], Truth(d, "load pull sinkage", {"radius": RADIUS})


WRITERS = (
    *(vesc_tool, tyre_test_consortium, rostopic_wrench, cube_rover, ardupilot_wheel_encoders),
    *(odometry_paths, inches_per_second, hub_motor_ramp, discrete_elements, design_of_wheels),
)
