"""Logs of rigs written after published descriptions of them, with what their columns hold.

Each writer returns the files and a `Truth`. `set_aside_rigs` has further ones.
"""

from dataclasses import dataclass, field

import numpy as np
from foreign_rigs import RADIUS, drive, noisy, table, wander, way

GRAVITY = 9.80665
RPM = 30.0 / np.pi


@dataclass
class Truth:
    """The samples of the first log (n,), in SI units at the wheel, and constants that it states.

    known: The quantities that the log holds, of rotation, travel, slip, torque, current, load,
        pull, sinkage; with several wheels, those of the first.
    """

    samples: object
    known: str
    constants: dict = field(default_factory=dict)
    every_row: bool = False

    def values(self, name):
        d = self.samples
        own = {"rotation": d.omega, "travel": d.v, "torque": d.torque, "load": d.load,
               "pull": d.pull, "sinkage": d.sinkage, "current": d.torque}  # fmt: skip
        if name == "slip":
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.where(d.omega > 0.05, 1 - d.v / (RADIUS * d.omega), 0.0)
        return own[name]


def write(file, columns, head=(), separator=",", units=None, **style):
    rows = table(columns.values(), separator, **style)
    second = [separator.join(units)] if units else []
    file.write_text("\n".join([*head, separator.join(columns), *second, *rows]), encoding="utf-8")
    return file


def sideways(rng, d, size=0.12):
    """A lateral force (n,) that wanders about a share of the load."""
    return d.load * (size + wander(rng, d.t.size, d.t[1], 0.03, 2.0))


def six_axes_load_on_y(rng, folder):
    """A wheel test bed whose sensor lies on its side; the file's name has constants."""
    d = drive(rng, (0.1, 0.3, 0.5), [138] * 3, rate=20)
    angle = np.degrees(way(d.t, d.omega)) * 6
    side = sideways(rng, d, 0.17)
    log = write(
        folder / "WHEELDIAMETER26.0_GEARRATIO6_SLIP_SWEEP_01.csv",
        {
            "Time [s]": d.t,
            "Horizontal Axis Position [mm]": 1000 * way(d.t, d.v),
            "Vertical Axis Position [mm]": 1000 * d.sinkage + rng.normal(0, 0.05, d.t.size),
            "Motor Position (counts)": np.round(angle / 360 * 4096),
            "Motor Position (before gearbox - degrees)": angle,
            "Force X [N]": noisy(rng, d.pull, 0.4),
            "Force Y [N]": noisy(rng, d.load, 0.5),
            "Force Z [N]": noisy(rng, side, 0.5),
            "Torque X [Nm]": noisy(rng, 0.11 * d.load, 0.05),
            "Torque Y [Nm]": noisy(rng, 0.02 * side, 0.05),
            "Torque Z [Nm]": noisy(rng, d.torque, 0.03),
        },
    )
    return [log], Truth(
        d, "rotation travel torque load pull sinkage", {"radius": RADIUS, "gear_ratio": 6}
    )


def six_axes_moments_first(rng, folder):
    """Force-torque sensor with the axle along x: load -z, torque about x; raw counts beside."""
    d = drive(rng, (0.1, 0.25, 0.4), [70] * 3, rate=20)
    side = sideways(rng, d, 0.2)
    log = write(
        folder / "ft_log.csv",
        {
            "t": d.t, "Mx": noisy(rng, d.torque, 0.03), "My": noisy(rng, 0.15 * d.load, 0.1),
            "Mz": noisy(rng, 0.05 * side, 0.03), "Fx": noisy(rng, side, 0.3),
            "Fy": noisy(rng, d.pull, 0.3), "Fz": noisy(rng, -d.load, 0.3),
            "omega_w": d.omega, "v_carriage": noisy(rng, d.v, 2e-4),
            "z_raw": 20000 - 400 * 1000 * d.sinkage, "sinkage_mm": 1000 * d.sinkage,
        },
        units=["s", "Nm", "Nm", "Nm", "N", "N", "N", "rad/s", "m/s", "counts", "mm"],
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def snow_rover(rng, folder):
    """MATLAB: a velocity called v_N, a current beside a torque, the slip of the log, mass known."""
    from scipy.io import savemat

    d = drive(rng, (0.1, 0.25, 0.4), [90] * 3, rate=20, speed=0.2)
    n = d.t.size
    savemat(
        folder / "drive_07.mat",
        {
            "t": d.t, "v_N": noisy(rng, d.v, 2e-3), "v_E": noisy(rng, 0 * d.v, 2e-3),
            "omega_wheel": d.omega, "T_wheel": noisy(rng, d.torque, 0.05),
            "motor_current": d.torque / 8 + 0.3 * (d.omega > 0.05),
            "slip": np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0.0),
            "sinkage_raw": rng.uniform(100, 3300, n), "battery_V": 24 + rng.normal(0, 0.1, n),
            "mass_kg": 4 * 90 / GRAVITY,
        },
    )  # fmt: skip
    return [folder / "drive_07.mat"], Truth(d, "rotation travel torque", {"mass": 4 * 90 / GRAVITY})


def pull_curves(rng, folder):
    """A digitised figure: slip, drawbar pull under its short name, load in each row."""
    d = drive(rng, (0.1, 0.3, 0.5, 0.7), [60, 60, 60, 60])
    slip = np.linspace(0.05, 0.7, 12)
    from foreign_rigs import law

    _, pull, sinkage = law(slip, 60.0 + 0 * slip)
    d.omega, d.v = np.ones(12), RADIUS * (1 - slip)
    d.load, d.pull, d.sinkage, d.t = 60.0 + 0 * slip, pull, sinkage, np.arange(12.0)
    log = write(
        folder / "fig7.csv",
        {"slip [%]": 100 * slip, "DBP [N]": pull, "Wv [N]": d.load, "z [mm]": 1000 * sinkage},
    )
    return [log], Truth(d, "slip load pull sinkage", every_row=True)


def parameters_beside(rng, folder):
    """RUN_PARAMETERS beside the log has the constants; encoder of the motor in revolutions."""
    d = drive(rng, (0.1, 0.3, 0.5), [64] * 3)
    (folder / "RUN_PARAMETERS.txt").write_text(
        "wheel_diameter_mm: 260\nwheel width [mm]: 120\ngear_ratio: 33\nload_N = 64\n"
    )
    log = write(
        folder / "run03.csv",
        {
            "elapsed_s": d.t, "motor_speed (rpm)": RPM * 33 * d.omega,
            "linear_position (mm)": noisy(rng, 1000 * way(d.t, d.v), 0.2),
            "wheel torque (Nm)": noisy(rng, d.torque, 0.03), "temp (C)": 21 + 0 * d.t,
        },
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load", {"radius": RADIUS, "gear_ratio": 33})


def units_in_words(rng, folder):
    """Units are written out, after names, in brackets and after dashes."""
    d = drive(rng, (0.1, 0.3, 0.5), [80] * 3)
    log = write(
        folder / "soilbin.csv",
        {
            "Time (seconds)": d.t,
            "Wheel rotation (after gearbox - degrees)": np.degrees(way(d.t, d.omega)),
            "Carriage travel - millimetres": 1000 * way(d.t, d.v),
            "Drive torque (newton metres)": noisy(rng, d.torque, 0.03),
            "Vertical force (newtons)": noisy(rng, d.load, 0.4),
            "Drawbar force (newtons)": noisy(rng, d.pull, 0.3),
            "Sinkage (millimetres)": 1000 * d.sinkage,
        },
    )
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def everything_for_the_radius(rng, folder):
    """Slip, rotation and travel are logged together, and nothing states the radius."""
    d = drive(rng, (0.1, 0.3, 0.5), [55] * 3)
    slip = np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0.0)
    log = write(
        folder / "sweep.csv",
        {"time_s": d.t, "wheel_rpm": RPM * d.omega, "cart_speed_mm_s": 1000 * d.v,
         "slip_ratio": slip, "F_n_N": noisy(rng, d.load, 0.3), "F_t_N": noisy(rng, d.pull, 0.3),
         "T_d_Nm": noisy(rng, d.torque, 0.03), "F_l_N": sideways(rng, d, 0.3)},
        digits=6,
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull", {"radius": RADIUS})


def symbols_only(rng, folder):
    """Letters of a paper: N, T, F_t, w, v, h; no units."""
    d = drive(rng, (0.1, 0.3, 0.5), [65] * 3)
    log = write(
        folder / "data.txt",
        {"t": d.t, "w": d.omega, "v": noisy(rng, d.v, 2e-4), "N": noisy(rng, d.load, 0.4),
         "F_t": noisy(rng, d.pull, 0.3), "T": noisy(rng, d.torque, 0.03), "h": d.sinkage},
        separator="\t", digits=6,
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def french_bench(rng, folder):
    """A French bench: effort normal, effort de traction, couple, enfoncement, vitesse."""
    d = drive(rng, (0.1, 0.25, 0.4), [75] * 3)
    log = write(
        folder / "essai_12.csv",
        {"Temps (s)": d.t, "Vitesse de rotation roue (tr/min)": RPM * d.omega,
         "Vitesse chariot (mm/s)": 1000 * d.v, "Couple moteur (N.m)": noisy(rng, d.torque, 0.03),
         "Effort normal (N)": noisy(rng, d.load, 0.4),
         "Effort latéral (N)": sideways(rng, d), "Effort de traction (N)": noisy(rng, d.pull, 0.3),
         "Enfoncement (mm)": 1000 * d.sinkage},
        head=["Banc d'essai roue", "Diamètre roue: 260 mm"], separator=";", decimal=",",
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage", {"radius": RADIUS})


def anonymous_forces(rng, folder):
    """A measurement computer that numbers its channels: forces 1 to 3 and a moment."""
    d = drive(rng, (0.1, 0.3, 0.5), [90] * 3)
    log = write(
        folder / "lv_0007.lvm",
        {"X_Value": d.t, "Force_0 (N)": sideways(rng, d, 0.1),
         "Force_1 (N)": noisy(rng, d.pull, 0.3),
         "Force_2 (N)": noisy(rng, d.load, 0.5), "Torque_0 (Nm)": noisy(rng, d.torque, 0.03),
         "Encoder (deg)": np.degrees(way(d.t, d.omega)), "String pot (mm)": 1000 * way(d.t, d.v),
         "LVDT (mm)": 1000 * d.sinkage},
        separator="\t", head=["LabVIEW Measurement", "Wheel radius: 0.13 m"],
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage", {"radius": RADIUS})


def rover_of_four(rng, folder):
    """A rover: current and speed of each motor, GNSS speed, mass and gearbox in the head."""
    d = drive(rng, (0.1, 0.25, 0.4), [50] * 3, speed=0.1)
    columns = {"stamp": 1.7e9 + d.t}
    for wheel in ("FL", "FR", "RL", "RR"):
        columns[f"{wheel}_motor_rpm"] = noisy(rng, RPM * 100 * d.omega, 0.3)
        columns[f"{wheel}_motor_mA"] = noisy(rng, 400 * d.torque, 5)
    columns |= {"gps_speed": noisy(rng, d.v, 1e-3), "imu_temp": 30 + 0 * d.t}
    head = ["# rover mass: 20.4 kg, 4 wheels", "# gear ratio: 100", "# wheel diameter 260 mm"]
    log = write(folder / "traverse.csv", columns, head=head)
    return [log], Truth(
        d, "rotation travel current", {"radius": RADIUS, "gear_ratio": 100, "mass": 20.4}
    )


def moments_as_depth(rng, folder):
    """z of a moment and of a force beside a depth, units behind dashes, load in kilograms."""
    d = drive(rng, (0.1, 0.3, 0.5), [98] * 3)
    log = write(
        folder / "rig_b.csv",
        {"Time, s": d.t, "M z, N mm": noisy(rng, 50 * d.load, 30),
         "M y, N mm": noisy(rng, 1000 * d.torque, 30),
         "F z, kg": noisy(rng, d.load / GRAVITY, 0.03),
         "F x, N": noisy(rng, d.pull, 0.3), "Drum speed, rad/s": d.omega,
         "Bed speed, mm/s": 1000 * d.v, "Carriage height, mm": 250 - 1000 * d.sinkage},
        separator=";",
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull sinkage")


def commanded_and_measured(rng, folder):
    """Set points beside measured values, and torque from the drive's own estimate in per cent."""
    d = drive(rng, (0.1, 0.3, 0.5), [60] * 3)
    ideal = np.where(d.omega > 0.05, 0.3, 0.0)
    log = write(
        folder / "exp_5_load60N.csv",
        {"time_ms": 1000 * d.t, "omega_cmd_rad_s": ideal, "omega_meas_rad_s": d.omega,
         "v_cmd_m_s": 0.03 + 0 * d.t, "v_meas_m_s": noisy(rng, d.v, 2e-4),
         "torque_cmd_Nm": 3 + 0 * d.t, "torque_meas_Nm": noisy(rng, d.torque, 0.03),
         "Fz_cmd_N": 60 + 0 * d.t, "Fz_meas_N": noisy(rng, d.load, 0.3),
         "Fx_meas_N": noisy(rng, d.pull, 0.3), "Fy_meas_N": sideways(rng, d)},
        digits=6,
    )  # fmt: skip
    return [log], Truth(d, "rotation travel torque load pull")


WRITERS = (six_axes_load_on_y, six_axes_moments_first, snow_rover, pull_curves, parameters_beside,
           units_in_words, everything_for_the_radius, symbols_only, french_bench,
           anonymous_forces, rover_of_four, moments_as_depth, commanded_and_measured)  # fmt: skip
