"""The map of drive.csv beside the true soil along it; `--make` draws the files.

A rover drives 60 m over three soils that drift within their patches. `soilml drive map` sees slip,
torque, load and position; the truth stands in truth.csv.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from soilml import Estimator, read_case, read_table, soil_map
from soilml.io.text_tables import csv_text
from soilml.report.aligned_text import format_table
from soilml.soil_maps.workflow import parameter_moments

HERE = Path(__file__).parent
SEED, EVERY = 21, 2  # Of the drive; steps of the simulation, of which one is a row
Z_90 = 1.645
#: Quantity, factor and unit of a line.
SHOWN = (
    ("cohesion_Pa", 1e-3, "kPa"),
    ("friction_angle_rad", 180.0 / np.pi, "deg"),
    ("shear_modulus_m", 1e3, "mm"),
)


def make() -> None:
    """Write drive.csv and truth.csv."""
    sys.path.insert(0, str(HERE.parents[1] / "bench"))
    from mapped_drives import simulate_map_drive

    drive = simulate_map_drive(SEED)
    wheels = len(np.unique(drive.columns["wheel"]))
    steps = np.arange(len(drive.patch)) // wheels
    kept = steps % EVERY == 0
    rounded = {n: v if n == "wheel" else np.round(v, 4) for n, v in drive.columns.items()}
    (HERE / "drive.csv").write_text(csv_text({n: v[kept] for n, v in rounded.items()}))
    truth = {name: drive.soil[kept, i] for i, (name, _, _) in enumerate(SHOWN)}
    truth = {name: np.asarray([float(f"{x:.5g}") for x in v]) for name, v in truth.items()}
    (HERE / "truth.csv").write_text(csv_text({"time_s": rounded["time_s"][kept], **truth}))


def compare() -> None:
    """Print the map, and a line for each parameter."""
    table = read_table(HERE / "drive.csv", filled=())
    found = soil_map(read_case(HERE / "rover.toml"), table, Estimator.load("wheel"))
    print(found.report().text(details=True))
    truth = read_table(HERE / "truth.csv", filled=())
    true = np.column_stack([truth[name] for name, _, _ in SHOWN])[found.drive.row]
    score, covariance = found.field.at(found.drive.place)
    mean, _ = parameter_moments(found.soils, score, covariance)
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    low, high = (
        parameter_moments(found.soils, score + side * Z_90 * std, 0.0 * covariance)[0]
        for side in (-1.0, 1.0)
    )
    rows = []
    for i, (name, factor, unit) in enumerate(SHOWN):
        held = np.mean((low[:, i] <= true[:, i]) & (true[:, i] <= high[:, i]))
        error = factor * np.sqrt(np.mean((mean[:, i] - true[:, i]) ** 2))
        ends = f"{factor * true[:, i].min():.1f} to {factor * true[:, i].max():.1f}"
        width = factor * np.median(high[:, i] - low[:, i])
        label = name.rpartition("_")[0].replace("_", " ")
        rows.append(
            (f"{label}, {unit}", ends, f"{error:.1f}", f"{width:.1f}", f"{100 * held:.0f} %")
        )
    print()
    header = ("along the path", "truth", "rmse", "width", "covered")
    print(format_table(header, rows, text_columns=1))


if __name__ == "__main__":
    make() if "--make" in sys.argv else compare()
