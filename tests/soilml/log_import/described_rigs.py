"""Logs of rigs written after published descriptions of them, with what their columns hold.

Each writer returns the files and a `Truth`. `set_aside_rigs` has further ones.
"""

import numpy as np
from foreign_rigs import RADIUS, drive, noisy
from rig_tables import DEGREES, GRAVITY, RPM, Truth, slip_of, writers

ALL = "rotation travel torque load pull sinkage"
R = {"radius": RADIUS}
RIGS = {
    # A wheel test bed whose sensor lies on its side; the file's name has constants.
    "six_axes_load_on_y": (ALL, {
        "Time [s]": "t", "Horizontal Axis Position [mm]": ("x", 1e3),
        "Vertical Axis Position [mm]": ("z", 1e3),
        "Motor Position (counts)": ("turn", 6 * 4096 / (2 * np.pi)),
        "Motor Position (before gearbox - degrees)": ("turn", 6 * DEGREES),
        "Force X [N]": "P", "Force Y [N]": "W", "Force Z [N]": ("side", 1.4),
        "Torque X [Nm]": ("W", 0.11), "Torque Y [Nm]": ("side", 0.02), "Torque Z [Nm]": "T"},
        {"file": "WHEELDIAMETER26.0_GEARRATIO6_SLIP_SWEEP_01.csv", "drive": {"load": 138},
         "constants": R | {"gear_ratio": 6}}),
    # Force-torque sensor with the axle along x: load -z, torque about x; raw counts beside.
    "six_axes_moments_first": (ALL, {
        "t": "t", "Mx": "T", "My": ("W", 0.15), "Mz": ("side", 0.05), "Fx": ("side", 1.6),
        "Fy": "P", "Fz": ("W", -1), "omega_w": "w", "v_carriage": "v",
        "z_raw": ("z", -4e5, 2e4), "sinkage_mm": ("z", 1e3)},
        {"units": ["s", "Nm", "Nm", "Nm", "N", "N", "N", "rad/s", "m/s", "counts", "mm"],
         "drive": {"load": 70, "slips": (0.1, 0.25, 0.4)}}),
    # A digitised figure: slip, drawbar pull under its short name, load in each row.
    "pull_curves": ("slip load pull sinkage", {
        "slip [%]": ("s", 100), "DBP [N]": "P", "Wv [N]": "W", "z [mm]": ("z", 1e3)},
        {"file": "fig7.csv", "rows": 12, "drive": {"load": 60}}),
    # RUN_PARAMETERS beside the log has the constants; encoder of the motor in revolutions.
    "parameters_beside": ("rotation travel torque load", {
        "elapsed_s": "t", "motor_speed (rpm)": ("w", 33 * RPM), "linear_position (mm)": ("x", 1e3),
        "wheel torque (Nm)": "T", "temp (C)": ("one", 21)},
        {"file": "run03.csv", "drive": {"load": 64}, "constants": R | {"gear_ratio": 33},
         "beside": {"RUN_PARAMETERS.txt": "wheel_diameter_mm: 260\nwheel width [mm]: 120\n"
                                          "gear_ratio: 33\nload_N = 64\n"}}),
    # Units are written out, after names, in brackets and after dashes.
    "units_in_words": (ALL, {
        "Time (seconds)": "t", "Wheel rotation (after gearbox - degrees)": ("turn", DEGREES),
        "Carriage travel - millimetres": ("x", 1e3), "Drive torque (newton metres)": "T",
        "Vertical force (newtons)": "W", "Drawbar force (newtons)": "P",
        "Sinkage (millimetres)": ("z", 1e3)}, {"drive": {"load": 80}}),
    # Slip, rotation and travel are logged together, and nothing states the radius.
    "everything_for_the_radius": ("rotation travel torque load pull", {
        "time_s": "t", "wheel_rpm": ("w", RPM), "cart_speed_mm_s": ("v", 1e3), "slip_ratio": "s",
        "F_n_N": "W", "F_t_N": "P", "T_d_Nm": "T", "F_l_N": ("side", 2.5)},
        {"digits": 6, "drive": {"load": 55}, "constants": R}),
    # Letters of a paper: N, T, F_t, w, v, h; no units.
    "symbols_only": (ALL, {
        "t": "t", "w": "w", "v": "v", "N": "W", "F_t": "P", "T": "T", "h": "z"},
        {"file": "data.txt", "separator": "\t", "digits": 6, "drive": {"load": 65}}),
    # A French bench: effort normal, effort de traction, couple, enfoncement, vitesse.
    "french_bench": (ALL, {
        "Temps (s)": "t", "Vitesse de rotation roue (tr/min)": ("w", RPM),
        "Vitesse chariot (mm/s)": ("v", 1e3), "Couple moteur (N.m)": "T",
        "Effort normal (N)": "W", "Effort latéral (N)": "side", "Effort de traction (N)": "P",
        "Enfoncement (mm)": ("z", 1e3)},
        {"head": ["Banc d'essai roue", "Diamètre roue: 260 mm"], "separator": ";", "decimal": ",",
         "drive": {"load": 75, "slips": (0.1, 0.25, 0.4)}, "constants": R}),
    # A measurement computer that numbers its channels: forces 1 to 3 and a moment.
    "anonymous_forces": (ALL, {
        "X_Value": "t", "Force_0 (N)": "side", "Force_1 (N)": "P", "Force_2 (N)": "W",
        "Torque_0 (Nm)": "T", "Encoder (deg)": ("turn", DEGREES), "String pot (mm)": ("x", 1e3),
        "LVDT (mm)": ("z", 1e3)},
        {"file": "lv_0007.lvm", "separator": "\t", "drive": {"load": 90}, "constants": R,
         "head": ["LabVIEW Measurement", "Wheel radius: 0.13 m"]}),
    # A rover: current and speed of each motor, GNSS speed, mass and gearbox in the head.
    "rover_of_four": ("rotation travel current", {
        "stamp": ("t", 1, 1.7e9), **{f"{n}_motor_rpm": ("w", 100 * RPM) for n in ("FL", "FR", "RL",
        "RR")}, **{f"{n}_motor_mA": ("T", 400) for n in ("FL", "FR", "RL", "RR")},
        "gps_speed": "v", "imu_temp": ("one", 30)},
        {"head": ["# rover mass: 20.4 kg, 4 wheels", "# gear ratio: 100",
                  "# wheel diameter 260 mm"],
         "drive": {"load": 50, "slips": (0.1, 0.25, 0.4), "speed": 0.1},
         "constants": R | {"gear_ratio": 100, "mass": 20.4}}),
    # z of a moment and of a force beside a depth, units behind dashes, load in kilograms.
    "moments_as_depth": (ALL, {
        "Time, s": "t", "M z, N mm": ("W", 50), "M y, N mm": ("T", 1e3),
        "F z, kg": ("W", 1 / GRAVITY), "F x, N": "P", "Drum speed, rad/s": "w",
        "Bed speed, mm/s": ("v", 1e3), "Carriage height, mm": ("z", -1e3, 250)},
        {"separator": ";", "drive": {"load": 98}}),
    # Set points beside measured values, and torque from the drive's own estimate in per cent.
    "commanded_and_measured": ("rotation travel torque load pull", {
        "time_ms": ("t", 1e3), "omega_cmd_rad_s": ("one", 0.3), "omega_meas_rad_s": "w",
        "v_cmd_m_s": ("one", 0.03), "v_meas_m_s": "v", "torque_cmd_Nm": ("one", 3),
        "torque_meas_Nm": "T", "Fz_cmd_N": ("one", 60), "Fz_meas_N": "W", "Fx_meas_N": "P",
        "Fy_meas_N": "side"}, {"file": "exp_5_load60N.csv", "digits": 6, "drive": {"load": 60}}),
}  # fmt: skip


def snow_rover(rng, folder):
    """MATLAB: a velocity called v_N, a current beside a torque, the slip of the log, mass known."""
    from scipy.io import savemat

    d = drive(rng, (0.1, 0.25, 0.4), [90] * 3, rate=20, speed=0.2)
    savemat(
        folder / "drive_07.mat",
        {
            "t": d.t, "v_N": noisy(rng, d.v, 2e-3), "v_E": noisy(rng, 0 * d.v, 2e-3),
            "omega_wheel": d.omega, "T_wheel": noisy(rng, d.torque, 0.05),
            "motor_current": d.torque / 8 + 0.3 * (d.omega > 0.05), "slip": slip_of(d),
            "sinkage_raw": rng.uniform(100, 3300, d.t.size),
            "battery_V": 24 + rng.normal(0, 0.1, d.t.size), "mass_kg": 4 * 90 / GRAVITY,
        },
    )  # fmt: skip
    return [folder / "drive_07.mat"], Truth(d, "rotation travel torque", {"mass": 4 * 90 / GRAVITY})


WRITERS = (*writers(RIGS), snow_rover)
