"""Maps of simulated drives on stretches that were held out.

Fixed numbers of `soilml.soil_maps` were chosen on drives of other seeds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mapped_drives import SLIP_STD, TORQUE_NOISE, simulate_map_drive
from runner import ROOT, Bench, Row, Sample, each, table, with_error
from scipy.special import ndtri

from soilml import Estimator, read_case
from soilml.soil_maps.field import SoilField
from soilml.soil_maps.local_soils import (
    MapDrive,
    coordinates,
    follow,
    local_soils,
    moments,
    read_map_drive,
)

Floats = np.ndarray[Any, np.dtype[np.float64]]

TESTED = range(300, 308)
WORLDS: dict[str, dict[str, Any]] = {
    "one soil": {"patches": 1, "drift": 0.0},
    "smooth drift": {"patches": 1, "drift": 0.6},
    "sharp changes": {"drift": 0.0},
    "changes and drift": {},
    "drift, all typical errors": {"patches": 1, "drift": 0.6, "errors": 1.0},
    "changes and drift, all typical errors": {"errors": 1.0},
}
#: Middles of the stretches held out, m along the path, how far they are moved, and their length.
MIDDLES, MOVED, LENGTH = (10.0, 22.0, 34.0, 46.0, 56.0), 3.0, 4.0
Z_90 = 1.645
ABOUT = (
    f"Drives of docs/how-to/drive.md by the wheel of `datagen/blind_sets`, {len(TESTED)} a "
    "line: four wheels, 240 rows each over 60 m of a winding path. Soils change sharply up to "
    "twice, and drift smoothly by lengths of 3 to 12 m. Torque noise is 2 %, slip noise 0.02, and "
    "1 % of the rows have twice their torque. Five stretches of 4 m are held out, and all "
    "answers are for these. *Map*: `soilml drive map`. *One soil*: `Estimator.run` of all other "
    "rows. *Covered*: by the 90 % intervals of cohesion, friction angle and shear modulus. "
    "*Density*: mean logarithm of that of the true soil, in normal scores. The prior has about "
    "-3.7. "
    "Typical errors: those of sensors are drawn for each drive, those of bearing and contact for "
    "each patch. Numbers of the map were chosen on other seeds. After a density stands its "
    "standard error over drives."
)


def cases(sample: Sample) -> list[Row]:
    """Each drive of each world."""
    return [{"world": w, "seed": seed} for w in WORLDS for seed in sample.of(TESTED, 2)]


def one_drive(case: Row) -> list[Row]:
    """Measures of a drive by method."""
    simulated = simulate_map_drive(case["seed"], **WORLDS[case["world"]])
    rover = read_case(ROOT / "examples/map/rover.toml")
    drive = read_map_drive(simulated.columns, rover)
    soil, rng = simulated.soil[drive.row], np.random.default_rng([case["seed"], 2])
    begin = np.asarray(MIDDLES) + rng.uniform(-MOVED, MOVED, len(MIDDLES)) - 0.5 * LENGTH
    stretch = (drive.station[:, None] > begin) & (drive.station[:, None] < begin + LENGTH)
    held = stretch.any(axis=1)
    noise = {"slip": (SLIP_STD, 0.0), "torque": (0.0, TORQUE_NOISE)}
    estimator = Estimator.load(ROOT / "exported/wheel.onnx").on(noise=noise)
    own = (values[~held] for values in (drive.place, drive.station, drive.wheel, drive.row))
    kept = MapDrive(drive.of_rows(~held), *own, drive.source)
    soils = local_soils(estimator, kept, follow(estimator, kept))
    field, free = SoilField(soils), coordinates(estimator)
    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    true, places = ndtri((soil[held] - low) / width), drive.place[held]
    count = int(held.sum())
    mean, covariance = moments(estimator.run(**kept.rows), free)
    answers = {
        "map": field.at(places),
        "one soil": (np.tile(mean, (count, 1)), np.tile(covariance, (count, 1, 1))),
    }
    found = []
    for name, (mean, covariance) in answers.items():
        std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        found.append(
            {
                "method": name,
                "covered": (np.abs(true - mean) < Z_90 * std).mean(axis=0),
                "width": np.median(std, axis=0),
                "density": log_normal(true - mean, covariance).mean(),
            }
        )
    return found


def log_normal(residual: Floats, covariance: Floats) -> Floats:
    """Log density (n,) of normal distributions with these covariances at residuals (n, q)."""
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, residual[..., None])[..., 0]
    volume = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return -0.5 * (white**2).sum(axis=1) - volume - 1.5 * np.log(2.0 * np.pi)


def tables(rows: list[Row]) -> str:
    """Scores of each method in each world."""
    columns = {"covered: c / phi / K": each("covered", ".0%"), "width": each("width", ".2f")}
    columns["density"] = with_error("density")
    return table(rows, {"drives": "world", "answer": "method"}, columns)


SOIL_MAPS = Bench("map", "Soil along the way", ABOUT, cases, one_drive, tables)
