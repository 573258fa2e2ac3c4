"""Variants of one rig: words of many languages, units, signs, decoys and computed channels."""

import numpy as np
from described_rigs import GRAVITY, RPM, Truth, drive, noisy, sideways, way, write
from foreign_rigs import RADIUS

ALL = "rotation travel torque load"
#: Samples by name, of a drive `d` and a generator `r`.
SAMPLES = {
    "t": lambda d, r: d.t, "w": lambda d, r: d.omega, "v": lambda d, r: noisy(r, d.v, 2e-4),
    "T": lambda d, r: noisy(r, d.torque, 0.03), "W": lambda d, r: noisy(r, d.load, 0.4),
    "P": lambda d, r: noisy(r, d.pull, 0.3), "z": lambda d, r: d.sinkage,
    "x": lambda d, r: way(d.t, d.v), "rim": lambda d, r: RADIUS * d.omega,
    "side": lambda d, r: sideways(r, d), "one": lambda d, r: 1.0 + 0.0 * d.t,
    "noise": lambda d, r: r.standard_normal(d.t.size), "enc": lambda d, r: way(d.t, d.omega),
    "s": lambda d, r: np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0),
}  # fmt: skip
USUAL = {"time [s]": "t", "wheel speed [rad/s]": "w", "cart speed [m/s]": "v",
         "torque [Nm]": "T", "load [N]": "W"}  # fmt: skip
STATED = {"head": ["wheel radius: 0.13 m"]}
OWN = f" {ALL} sinkage"
#: Known quantities; column: samples, or samples, factor and offset; how it is written.
RIGS = {
    "japanese": (OWN, {"時間[s]": "t", "車輪角速度[rad/s]": "w", "台車速度[mm/s]": ("v", 1e3),
                 "トルク[Nm]": "T", "垂直荷重[N]": "W", "沈下量[mm]": ("z", 1e3)}, {}),
    "french": (OWN, {"temps": "t", "vitesse roue": "w", "vitesse avancement": "v", "couple": "T",
               "charge verticale": "W", "enfoncement": "z"}, {"separator": ";", "decimal": ","}),
    "italian": (OWN, {"tempo (s)": "t", "velocità ruota (giri/min)": ("w", RPM),
                "velocità carrello (m/s)": "v", "coppia (Nm)": "T", "carico verticale (N)": "W",
                "affondamento (mm)": ("z", 1e3)}, {"separator": ";", "decimal": ","}),
    "portuguese": (ALL, {"tempo [s]": "t", "rotação da roda [rpm]": ("w", RPM), "torque [Nm]": "T",
                   "velocidade do carrinho [m/s]": "v", "carga vertical [N]": "W"}, {}),
    "russian": ("", {"время [s]": "t", "угловая скорость колеса [rad/s]": "w",
                "скорость тележки [m/s]": "v", "крутящий момент [N m]": "T"}, {}),
    "odometry": ("rotation torque load", USUAL | {"cart speed [m/s]": ("rim", 1.05)}, {}),
    "current_as_torque": ("rotation travel load", USUAL | {"torque [Nm]": "one",
                          "torque_A": ("T", 0.3)}, {}),
    "load_in_kg": (ALL, {"time": "t", "wheel speed": "w", "cart speed": "v", "torque": "T",
                   "load": ("W", 1 / GRAVITY)}, STATED),
    "slip_in_per_cent": ("slip torque load", {"time [s]": "t", "slip": ("s", 100), "torque [Nm]":
                         "T", "load [N]": "W"}, {"slips": (0.05, 0.4, 0.95)}),
    "slip_of_few_per_cent": ("slip torque load", {"time [s]": "t", "slip": ("s", 100),
                             "torque [Nm]": "T", "load [N]": "W"}, {"slips": (0.01, 0.03, 0.06)}),
    "travel_ratio_as_slip": ("torque load", {"time [s]": "t", "slip ratio": ("s", -1, 1),
                             "torque [Nm]": "T", "load [N]": "W"}, {}),
    "depth_upward": (OWN, USUAL | {"depth [mm]": ("z", -1e3)}, {}),
    "height": (OWN, USUAL | {"axle height [mm]": ("z", -1e3, 130)}, {}),
    "sinkage_z": (OWN, USUAL | {"imu_z": ("noise", 0.05), "sinkage_z": ("z", 1e3)}, {}),
    "decoys": (ALL, USUAL | {"imu_z": ("noise", 0.02, 9.81), "mag_z": ("noise", 0.01, 0.3),
               "depth_frame": ("noise", 0.02, 1.2), "bin depth [m]": ("noise", 1e-3, 0.3),
               "cpu load [%]": ("noise", 3, 40), "slip angle [deg]": ("noise", 0.1, 2)}, {}),
    "milliseconds": (ALL, USUAL | {"time [s]": "one", "timestamp": ("t", 1e3, 1.7e12)}, {}),
    "two_equal_loads": ("rotation travel torque", {k: v for k, v in USUAL.items() if v != "W"}
                        | {"load A [N]": "W", "load B [N]": "W"}, {}),
    "offset_without_rest": ("rotation travel load", USUAL | {"torque [Nm]": ("T", 1, 3)},
                            {"rests": False}),
    "torque_in_N_cm": ("rotation travel load", USUAL | {"torque [Nm]": "one",
                       "torque": ("T", 100)}, {}),
    "load_not_tared": ("rotation travel torque", USUAL | {"load [N]": ("W", 1, -55)}, {}),
    "load_of_another_mass": ("rotation travel torque", USUAL | {"load [N]": ("W", 4)},
                             {"head": ["vehicle mass: 25 kg", "wheels: 4"]}),
    "load_in_volts": ("rotation travel torque", USUAL | {"load [N]": "one",
                      "load cell [V]": ("W", 0.02)}, {}),
    "km_h": ("torque load", {"time": "t", "wheel speed": ("rim", 3.6), "ground speed": ("v", 3.6),
             "torque": "T", "load": "W"}, STATED),
    "motor_rpm": ("travel torque load", {"time": "t", "motor speed": ("w", 30 * RPM),
                  "ground speed": "v", "torque": "T", "load": "W"}, STATED),
    "hertz": (ALL, USUAL | {"wheel speed [rad/s]": "one", "wheel frequency [Hz]": ("w", 0.159155)},
              {}),
    "encoder": ("travel torque load", USUAL | {"wheel speed [rad/s]": "one",
                "wheel encoder": ("enc", 500)}, {}),
    "other_speeds": ("torque load", {"time [s]": "t", "fan speed [rpm]": ("noise", 20, 2e3),
                     "wind speed [m/s]": ("noise", 0.3, 2), "torque [Nm]": "T", "load [N]": "W"},
                     {}),
    "lateral_force": (ALL, USUAL | {"lateral force [N]": "side"}, {}),
    "inches": (OWN, {"time (sec)": "t", "wheel rpm": ("w", RPM), "torque (in-lb)": ("T", 8.8507),
               "carriage speed (in/s)": ("v", 39.37), "load (lbf)": ("W", 0.22481),
               "sinkage (in)": ("z", 39.37)}, {}),
    "minutes": (ALL, {"time (min)": ("t", 1 / 60), "wheel speed (rpm)": ("w", RPM),
                "travel speed (ft/min)": ("v", 196.85), "torque (ft-lb)": ("T", 0.73756),
                "load (lb)": ("W", 0.22481)}, {"digits": 9}),
}  # fmt: skip


def writer(name):
    known, columns, style = RIGS[name]

    def written(rng, folder):
        own = {"digits": 6} | style
        d = drive(rng, own.pop("slips", (0.1, 0.3, 0.5)), [62.0] * 3, rate=20)
        if not own.pop("rests", True):
            keep = (d.t > 5) & (d.t < d.t[-1] - 3)
            for key in ("t", "load", "omega", "v", "torque", "pull", "sinkage"):
                setattr(d, key, getattr(d, key)[keep])
        found = {}
        for column, given in columns.items():
            sample, *change = (given,) if isinstance(given, str) else given
            factor, offset = (*change, *(1, 0)[len(change) :])
            found[column] = factor * SAMPLES[sample](d, rng) + offset
        return [write(folder / f"{name}.csv", found, **own)], Truth(d, known)

    written.__name__ = name
    return written


WRITERS = tuple(map(writer, RIGS))
