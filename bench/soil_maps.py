"""Maps of simulated drives on stretches that were held out.

Fixed numbers of `soilml.soil_maps` were chosen on drives of the seeds `TUNED`; the tables are of
others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mapped_drives import SLIP_STD, TORQUE_NOISE, simulate_map_drive
from runner import ROOT, Bench, Row, Sample, each, markdown, table
from scipy.special import ndtri
from slip_drives import GRAVITY, MASS, SLIPS, ground_forces, loads

from soilml import Estimator, SoilTracker, read_case
from soilml.soil_maps.ability import map_ability
from soilml.soil_maps.drive import MapDrive, read_map_drive
from soilml.soil_maps.field import SoilField
from soilml.soil_maps.held_out import torque_score
from soilml.soil_maps.local_soils import (
    coordinates,
    follow,
    local_soils,
    moments,
    with_exact_sensors,
)

Floats = np.ndarray[Any, np.dtype[np.float64]]

TUNED, TESTED = range(1, 7), range(300, 308)
WORLDS: dict[str, dict[str, Any]] = {
    "one soil": {"patches": 1, "drift": 0.0},
    "smooth drift": {"patches": 1, "drift": 0.6},
    "sharp changes": {"drift": 0.0},
    "changes and drift": {},
    "drift, all typical errors": {"patches": 1, "drift": 0.6, "errors": 1.0},
    "changes and drift, all typical errors": {"errors": 1.0},
}
METHODS = ("map", "tracker", "one soil")
#: Middles of the stretches held out, m along the path, how far they are moved, and their length.
MIDDLES, MOVED, LENGTH = (10.0, 22.0, 34.0, 46.0, 56.0), 3.0, 4.0
SLOPE = np.deg2rad(15.0)  # That the rover is to climb
EVERY = 8  # Of the rows held out, one in so many is asked whether the slope is climbed
SLIP_LIMIT = 0.6
Z_90 = 1.645
BANDS = {"said 0 to 0.2": (0.0, 0.2), "0.2 to 0.8": (0.2, 0.8), "0.8 to 1": (0.8, 1.0)}
ABOUT = (
    f"Drives of docs/how-to/drive.md by the wheel of `datagen/blind_sets`, {len(TESTED)} a "
    "line: four wheels, 240 rows each over 60 m of a winding path. Soils change sharply up to "
    "twice, and drift smoothly by lengths of 3 to 12 m. Torque noise is 2 %, slip noise 0.02, and "
    "1 % of the rows have twice their torque. Five stretches of 4 m are held out, and all "
    "answers are for these. *Map*: `soilml drive map`. *Tracker*: the last estimate of "
    "`SoilTracker` before the stretch. *One soil*: `Estimator.run` of all other rows. *Covered*: "
    "by the 90 % intervals of cohesion, friction angle and shear modulus. *Density*: mean "
    "logarithm of that of the true soil, in normal scores. The prior has about -3.7. *Torque*: "
    "the same of the torque of a row in N m, given slip and load. *Climb*: mean logarithm "
    "of the probability of what happens on 15 degrees. "
    "The second table has how often the rover climbs, by the probability that was said. "
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
    exact, kept = with_exact_sensors(estimator), drive.part(~held)
    soils = local_soils(estimator, kept, follow(estimator, kept))
    field, free = SoilField(soils), coordinates(estimator)
    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    true, places = ndtri((soil[held] - low) / width), drive.place[held]
    count = int(held.sum())
    one, one_read = (
        (np.tile(mean, (count, 1)), np.tile(covariance, (count, 1, 1)))
        for mean, covariance in (moments(e.run(**kept.rows), free) for e in (estimator, exact))
    )
    answers = {
        "map": (field.at(places), field.at(places, as_read=True)),
        "tracker": tracked(estimator, exact, drive, held, free),
        "one soil": (one, one_read),
    }
    at = np.arange(0, count, EVERY)
    climbs = np.asarray([climbs_slope(soil[held][i]) for i in at])
    found = []
    for name, ((mean, covariance), as_read) in answers.items():
        std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        climb = map_ability(rover, soils, mean[at], covariance[at], np.asarray([0.0, SLOPE]))
        likely = np.clip(climb.climbed[:, 1], 0.01, 0.99)
        draws = np.random.default_rng(0)
        torque = torque_score(rover, exact, drive.part(held), soils, as_read, draws)
        found.append(
            {
                "method": name,
                "covered": (np.abs(true - mean) < Z_90 * std).mean(axis=0),
                "width": np.median(std, axis=0),
                "density": log_normal(true - mean, covariance).mean(),
                "torque": torque.mean(),
                "climb": np.log(np.where(climbs, likely, 1.0 - likely)).mean(),
                "said": likely,
                "climbs": climbs,
            }
        )
    return found


def tracked(
    estimator: Estimator, exact: Estimator, drive: MapDrive, held: Floats, free: list[Any]
) -> list[tuple[Floats, ...]]:
    """Moments of the tracker's estimate before each row held out; and as sensors show the soil."""
    tracker, used, known = SoilTracker(estimator), [], {}
    found: list[list[Any]] = [[], []]
    for i in range(len(held)):
        if not held[i]:
            state = tracker.read(**{name: float(v[i]) for name, v in drive.rows.items()})
            if state.event.name in ("ACCEPTED", "DRIFT", "SOIL_CHANGED"):
                used.append(i)
            continue
        if len(used) not in known:
            window = used[-max(tracker.state.rows_remembered, 1) :]
            read = exact.run(**drive.of_rows(window))
            known[len(used)] = [moments(e, free) for e in (tracker.state.estimate, read)]
        for own, answer in zip(found, known[len(used)], strict=True):
            own.append(answer)
    return [tuple(np.asarray(part) for part in zip(*own, strict=True)) for own in found]


def log_normal(residual: Floats, covariance: Floats) -> Floats:
    """Log density (n,) of normal distributions with these covariances at residuals (n, q)."""
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, residual[..., None])[..., 0]
    volume = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return -0.5 * (white**2).sum(axis=1) - volume - 1.5 * np.log(2.0 * np.pi)


def climbs_slope(soil: Floats) -> bool:
    """Whether the reference wheel's rover climbs the slope on a soil, by a slip up to the limit."""
    names = ("cohesion", "friction_angle", "shear_modulus")
    sand = {"kc": 990.0, "kphi": 1528430.0, "n": 1.1, "a0": 0.4, "a1": 0.15, "unit_weight": 15e3}
    forces = ground_forces(dict(zip(names, soil.tolist(), strict=True)) | sand)
    slip = SLIPS[(SLIPS > 0.0) & (SLIPS <= SLIP_LIMIT)]
    pull = forces.pull(slip[:, None], np.broadcast_to(loads(np.asarray(SLOPE)), (len(slip), 4)))
    return bool(pull.sum(axis=1).max() >= MASS * GRAVITY * np.sin(SLOPE))


def with_error(key: str) -> Callable[[list[Row]], str]:
    """Mean over drives, and its standard error."""

    def cell(rows: list[Row]) -> str:
        means = np.asarray([row[key] for row in rows])
        return f"{means.mean():.2f} ± {means.std(ddof=1) / np.sqrt(len(means)):.2f}"

    return cell


def said(rows: Sequence[Row], low: float, high: float) -> str:
    """How often the rover climbs where this was said of it."""
    told, climbs = (np.concatenate([row[key] for row in rows]) for key in ("said", "climbs"))
    own = (told >= low) & (told < high)
    if not own.any():
        return "-"
    shares = 100 * climbs[own].mean(), 100 * told[own].mean()
    return f"{shares[0]:.0f} % of {own.sum()} (said {shares[1]:.0f} %)"


def tables(rows: list[Row]) -> str:
    """Scores of each method in each world; what was said of a slope, and what happened."""
    columns = {"covered: c / phi / K": each("covered", ".0%"), "width": each("width", ".2f")}
    columns |= {key: with_error(key) for key in ("density", "torque", "climb")}
    lines = [
        (name, *(said([r for r in rows if r["method"] == name], *ends) for ends in BANDS.values()))
        for name in METHODS
    ]
    scores = table(rows, {"drives": "world", "answer": "method"}, columns)
    return f"{scores}\n\n{markdown(('answer', *BANDS), lines)}"


SOIL_MAPS = Bench("map", "Soil along the way", ABOUT, cases, one_drive, tables)
