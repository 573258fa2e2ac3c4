"""Logs of rigs written after published descriptions, set aside while the guesses were made."""

import numpy as np
from described_rigs import ALL, R
from rig_tables import DEGREES, GRAVITY, RPM, writers

RIGS = {
    # Six axes on the axle: x points down, the torque is about z; diameter in the name in cm.
    "axle_sensor_on_x": (ALL, {
        "Time(s)": "t", "FTS Fx(N)": "W", "FTS Fy(N)": "P", "FTS Fz(N)": ("side", 1.25),
        "FTS Mx(Nm)": ("side", 0.04), "FTS My(Nm)": ("W", 0.14), "FTS Mz(Nm)": "T",
        "Encoder raw": ("turn", 14 * 2000 / (2 * np.pi)), "Cart position (mm)": ("x", 1e3),
        "Motor speed (rpm, before gearbox)": ("w", 14 * RPM), "Laser (mm)": ("z", -1e3, 180)},
        {"file": "Wheel_D26cm_GR14_trial2.csv", "constants": R | {"gear_ratio": 14},
         "drive": {"load": 110, "slips": (0.05, 0.2, 0.4)}}),
    # Chinese institute, English symbols: F_N, F_DP, M_D, z, omega, v, units in a second row.
    "planetary_bed": (ALL, {
        "t": "t", "omega": "w", "v": "v", "F_N": "W", "F_DP": "P", "F_S": "side", "M_D": "T",
        "M_R": ("W", 0.1), "z": ("z", 1e3)},
        {"file": "no12.txt", "separator": "\t", "drive": {"load": 80},
         "units": ["s", "rad/s", "m/s", "N", "N", "N", "N.m", "N.m", "mm"]}),
    # A JSON file beside the log states the wheel; slip is set by the carriage.
    "metadata_beside": ("rotation travel torque load pull", {
        "timestamp_ms": ("t", 1e3), "drive_motor_rpm": ("w", 50 * RPM),
        "carriage_velocity_mmps": ("v", 1e3), "normal_force_N": "W", "tractive_force_N": "P",
        "wheel_torque_Nm": "T"},
        {"file": "T07.csv", "drive": {"load": 70, "cart": True},
         "constants": R | {"gear_ratio": 50},
         "beside": {"metadata.json": '{\n  "wheel_radius_mm": 130,\n  "wheel_width_mm": 100,\n'
                                     '  "gear_ratio": 50,\n  "operator": "A"\n}\n'}}),
    # Agricultural soil bin: gross traction as a torque, net traction, dynamic load in kN.
    "tyre_in_a_bin": (ALL, {
        "Time [s]": "t", "Dynamic load [kN]": ("W", 1e-3), "Net traction [kN]": ("P", 1e-3),
        "Input torque [N·m]": "T", "Axle speed [rev/min]": ("w", RPM),
        "Carrier speed [km/h]": ("v", 3.6), "Rut depth [cm]": ("z", 100),
        "Inflation pressure [kPa]": ("one", 110)},
        {"digits": 6, "drive": {"load": 900, "slips": (0.08, 0.2, 0.35)}}),
    # Topics as columns of CSV: wrench of the wheel, joint state, pose from tracking.
    "ros_wrench": ("rotation travel torque load pull", {
        "%time": ("t", 1e9, 1.7e18), "ft_sensor.wrench.force.x": ("P", -1),
        "ft_sensor.wrench.force.y": "side", "ft_sensor.wrench.force.z": ("W", -1),
        "ft_sensor.wrench.torque.x": ("W", 0.08), "ft_sensor.wrench.torque.y": ("T", -1),
        "ft_sensor.wrench.torque.z": ("noise", 0.03), "joint_states.velocity": "w",
        "joint_states.effort": ("one", 0.5), "mocap.pose.position.x": "x",
        "mocap.pose.position.y": ("one", 0.5), "mocap.pose.position.z": ("z", -1, 0.2)},
        {"digits": 6, "drive": {"load": 60}}),
    # A supplement: i, F_H, F_V, Q, delta z for each run; standard errors beside.
    "torque_table": ("slip torque load pull sinkage", {
        "Slip ratio i (-)": "s", "Drawbar pull F_H (N)": "P", "Vertical load F_V (N)": "W",
        "Driving torque Q (N mm)": ("T", 1e3), "Sinkage (mm)": ("z", 1e3)},
        {"rows": 10, "drive": {"load": 50}}),
    # Spanish headers in capitals, unit in words, load negative.
    "spanish_symbols": ("rotation travel torque load pull", {
        "TIEMPO (segundos)": "t", "VELOCIDAD RUEDA (grados/s)": ("w", DEGREES),
        "VELOCIDAD CARRO (milimetros/s)": ("v", 1e3), "FUERZA VERTICAL (newton)": ("W", -1),
        "FUERZA HORIZONTAL (newton)": "P", "FUERZA LATERAL (newton)": ("side", 2),
        "PAR MOTOR (newton metro)": "T"},
        {"file": "prueba 9.csv", "separator": ";", "decimal": ",", "drive": {"load": 60}}),
    # One leg of a rover on a gantry: velocity NED, dead load by file name, motor amps.
    "rocker_leg": ("rotation travel current load", {
        "t_s": "t", "v_N": "v", "v_E": ("noise", 1e-3), "v_D": ("noise", 1e-3),
        "wheel_omega": "w", "I_mot": ("T", 1 / 6), "V_mot": ("noise", 0.05, 24),
        "yaw_deg": ("noise", 0.2, 12)},
        {"file": "leg_7kg_r130mm_run1.csv", "drive": {"load": 7 * GRAVITY, "speed": 0.06},
         "constants": R}),
    # S-beam cells left and right carry the wheel, a third one pulls; torque transducer in mV.
    "two_cells_and_idle": (ALL, {
        "Elapsed time [s]": "t", "Load cell vertical left [N]": ("W", 0.45),
        "Load cell vertical right [N]": ("W", 0.55), "Load cell horizontal [N]": "P",
        "Torque transducer [mV]": ("T", 1 / 0.425), "Wheel encoder [deg]": ("turn", DEGREES),
        "Belt speed [cm/s]": ("v", 100), "Dial gauge [mm]": ("z", 1e3)},
        {"head": ["Torque transducer: 1 mV = 0.425 N m", "wheel radius r = 130 mm"],
         "drive": {"load": 84}, "constants": R}),
    # A small wheel: mN, mN m, mm, deg/s; force plate axes called vertical, fore-aft, lateral.
    "micro_rover_wheel": (ALL, {
        "time/s": "t", "vertical/mN": ("W", 1e3), "fore-aft/mN": ("P", 1e3),
        "lateral/mN": ("side", 1e3), "torque/mNm": ("T", 1e3), "rotation/(deg/s)": ("w", DEGREES),
        "stage/(mm/s)": ("v", 1e3), "sinkage/mm": ("z", 1e3)}, {"drive": {"load": 9}}),
    # Slip in per cent, thrust, normal reaction and power; speeds are of the carriage alone.
    "slip_logged_only": ("slip torque load pull sinkage", {
        "Sample": "n", "Time_s": "t", "Slip_pct": ("s", 100), "Normal_reaction_N": "W",
        "Thrust_N": "P", "Shaft_torque_Nm": "T", "Power_W": "power", "Subsidence_mm": ("z", 1e3)},
        {"file": "test 3 (66 N).csv", "digits": 5, "drive": {"load": 66}}),
    # Vertical axis is Y: FY is the load, FX the pull, TZ the torque, POS_X, POS_Y; no units.
    "capitals_and_axes": (ALL, {
        "TIME": "t", "POS_X": ("x", 1e3), "POS_Y": ("z", -1e3), "FX": "P", "FY": "W",
        "FZ": "side", "TX": ("W", 0.09), "TY": ("noise", 0.05), "TZ": "T", "RPM": ("w", RPM)},
        {"file": "LOG0042_R130mm.TXT", "separator": "\t", "drive": {"load": 120}, "constants": R}),
}  # fmt: skip
WRITERS = writers(RIGS)
