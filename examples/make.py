"""Write the simulated measurements of the examples, which `soilml example` copies.

python examples/make.py            all; each stands in a folder of its name beside this file
python examples/make.py track      one
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from soilml import Case, Operating, SlipSinkage, Table, read_case, simulate, soil
from soilml.io.text_tables import csv_text
from soilml.systems.rim_stress import SensingWheel, SteadyRun, balanced_arc, simulate_readings
from soilml.systems.rim_stress.climbs import WHEELS, Climb, WheelRun
from soilml.systems.rim_stress.simulation import SLOPES, SimulatedRover
from soilml.systems.tracked_robot.track_log import LASERS, LOG
from soilml.systems.wheel_legs.stride_relations import (
    S_I,
    S_Z,
    SINKAGE_ERRORS,
    TORQUE,
    VIBRATION,
)

FOLDER = Path(__file__).parent
LOADS = (40.0, 55.0, 70.0, 85.0, 100.0, 115.0)  # N
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
MEASURED = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
RATE, STAGE, RADIUS = 50.0, 6.0, 0.15  # Rows a second, seconds at each slip, m


def rows(model: Path, *hidden: Any) -> Table:
    """A campaign with noise, by a model to which hidden effects are added."""
    case = read_case(model)
    for effect in hidden:
        case = replace(case, model=case.model + effect)
    slip, load = np.tile(SLIPS, len(LOADS)), np.repeat(LOADS, len(SLIPS))
    names = np.repeat([f"load_{load:.0f}" for load in LOADS], len(SLIPS))
    return simulate(case, slip, load, run=names, seed=1)


def campaign(folder: Path) -> dict[str, str]:
    """A campaign on a wheel that digs itself in with slip, which its model lacks."""
    table = rows(folder / "model.toml", SlipSinkage(n1=0.4))
    return {"runs.csv": csv_text({name: table[name] for name in MEASURED})}


def log(folder: Path) -> dict[str, str]:
    """The recording of a rig under one load: a rest, then a stage at each slip."""
    table = rows(folder / "model.toml").where("load_N", "70")
    rng = np.random.default_rng(2)
    stage = np.repeat(np.arange(len(SLIPS) + 1), round(STAGE * RATE))
    moving = stage > 0

    def recorded(name: str, std: float) -> Any:
        values = np.concatenate([[0.0], table[name]])[stage]
        return values + std * rng.standard_normal(stage.size)

    slip = np.concatenate([[0.0], table["slip"]])[stage]
    columns = {
        "time [ms]": 1e3 * np.arange(stage.size) / RATE,
        "wheel speed [deg/s]": np.where(moving, np.degrees(0.05 / RADIUS), 0.0),
        "carriage speed [mm/s]": np.where(moving, 50.0 * (1.0 - slip), 0.0)
        + 0.1 * rng.standard_normal(stage.size),
        "torque [Nm]": recorded("torque_Nm", 0.05),
        "drawbar pull [N]": recorded("drawbar_pull_N", 0.3),
        "load [N]": 70.0 + 0.5 * rng.standard_normal(stage.size),
        "sinkage [mm]": 1e3 * recorded("sinkage_m", 2e-4),
    }
    text = csv_text({name: np.round(values, 4) for name, values in columns.items()})
    return {"rig.csv": f"Radius: {1e3 * RADIUS:.0f} mm\n{text}"}


def sensor_wheel(folder: Path) -> dict[str, str]:
    """Five turns of the wheel of Nagatani et al. 2009 on each of four slopes, k_x 7.2 mm."""
    wheel, sand = SensingWheel(), soil("nagatani2009/toyoura_sand")
    rng, runs = np.random.default_rng(4), {}
    readings: dict[str, list[Any]] = {"run": [], "angle_rad": [], "sensor": [], "force_N": []}
    for k, (slip, slope) in enumerate(((0.11, 0), (0.18, 2), (0.29, 4), (0.39, 6))):
        at = SteadyRun(slip=slip, weight=28.92, slope=np.deg2rad(slope))
        arc = balanced_arc(np.deg2rad(30.0), at, wheel, sand)
        found = simulate_readings(arc, wheel, turns=5, crown=0.3, lugs=(0.3, 0.3), seed=k)
        near = np.abs(found["angle_rad"]) < 1.0
        readings["run"] += [f"slope_{slope}"] * int(near.sum())
        for name, values in found.items():
            digits = 4 if name == "force_N" else 5
            readings[name] += values[near].round(digits).tolist()
        read = round(slip + 0.01 * (1.0 - slip) * float(rng.standard_normal()), 4)
        runs[f"slope_{slope}"] = (read, 0.01, 28.92, 0.3, round(float(at.slope), 5))
    names = ("slip", "slip_std", "load_N", "load_N_std", "slope_rad")
    table = dict(zip(names, zip(*runs.values(), strict=True), strict=True))
    return {
        "runs.csv": csv_text({"run": list(runs), **table}),
        "readings.csv": csv_text(readings),
    }


def climb_tables(
    climbs: Sequence[Climb],
    front: Sequence[WheelRun] = (),
    rear: Sequence[WheelRun] = (),
    *,
    rim_speed: float,
) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """Tables (runs, stresses) of columns as they are read, with speeds by that of the rim (m/s).

    `front` and `rear` are stresses at artificial slip, which become runs without a slope.
    """
    each = [
        (climb.name, wheel, climb.slope, run)
        for climb in climbs
        for wheel, run in zip(WHEELS, climb.wheels, strict=True)
    ]
    for wheel, artificial in zip(WHEELS, (front, rear), strict=True):
        each += [(f"flat_{wheel}_{i}", wheel, np.nan, r) for i, r in enumerate(artificial, 1)]
    runs: dict[str, list[Any]] = {
        "run": [name for name, _, _, _ in each],
        "wheel": [wheel for _, wheel, _, _ in each],
        "slope_rad": [slope for _, _, slope, _ in each],
        "speed_m_s": [rim_speed * (1.0 - run.slip) for _, _, _, run in each],
        "rim_speed_m_s": [rim_speed for _ in each],
    }
    samples = [
        (name, wheel, float(angle), float(normal))
        for name, wheel, _, run in each
        for angle, normal in zip(run.profile.angle, run.profile.normal, strict=True)
    ]
    names = ("run", "wheel", "angle_rad", "normal_Pa")
    return runs, {n: list(own) for n, own in zip(names, zip(*samples, strict=True), strict=True)}


def climb(folder: Path) -> dict[str, str]:
    """Climbs of 0 and 4 degrees, and artificial slip on the flat."""
    true, rng = SimulatedRover(), np.random.default_rng(4)
    climbs = true.simulate_climbs(rng, SLOPES[:2])
    tables = climb_tables(climbs, *true.simulate_artificial_slip(rng, repeats=2), rim_speed=0.00915)
    return {"runs.csv": csv_text(tables[0]), "stress.csv": csv_text(tables[1])}


def wheel_leg(folder: Path) -> dict[str, str]:
    """Strides on SSC-1 and ES-3 by the printed relations, with the errors of table VIII."""
    rng, columns = np.random.default_rng(4), dict[str, list[Any]]()
    errors = (TORQUE.errors, VIBRATION.errors, SINKAGE_ERRORS)
    for k, name, angle in ((0, "SSC-1", 0.7381), (3, "ES-3", 0.6254)):
        slip, noise = np.linspace(0.1, 0.4, 12), rng.standard_normal((3, 12))
        angles = [angle * (1.0 + 0.01 * own.friction[k]) for own in errors]
        read = []
        for relation, phi, z in zip((TORQUE, VIBRATION), angles, noise, strict=False):
            (p, q), (r, s) = relation.at_none, relation.rate
            y = (phi - relation.to_soil[0, 0]) / relation.to_soil[0, 1]
            read.append((slip + 0.03 * z - p - y * r) / (q + y * s))
        sunk = (angles[2] - S_I) / S_Z * (1.0 + 0.05 * noise[2])
        own = {"run": [name] * 12, "slip": slip, "torque_Nm": read[0], "vibration_m_s2": read[1]}
        for key, values in (own | {"sinkage_m": sunk}).items():
            cells = values if key == "run" else np.round(values, 4).tolist()
            columns.setdefault(key, []).extend(cells)
    return {"strides.csv": csv_text(columns)}


def simulate_log(
    case: Case, slips: Any, load: float, spacing: float, rng: np.random.Generator
) -> dict[str, list[Any]]:
    """Columns of a log of pulls at slips, 20 Hz: the payload tightens, then the robot pulls on.

    The tension has oscillations of 5 %, the lasers a millimetre of noise, and ruts of 4 mm.
    """
    at = Operating(slip=np.asarray(slips, float), load=load)
    force, track = case.model(case.soil, at), case.model.gear
    belt = track.contact_geometry(np.asarray(force.sinkage), case.soil, at)
    columns: dict[str, list[Any]] = {name: [] for name in ("run", "time_s", *LOG[1:], *LASERS)}
    time = np.arange(0.0, 40.0, 0.05)
    tight = np.clip((time - 4.0) / 4.0, 0.0, 1.0)
    trims, rears = np.asarray(belt.trim), np.asarray(belt.rear)
    for k, (slip, pull) in enumerate(zip(slips, np.asarray(force.drawbar_pull), strict=True)):
        turned = 0.05 * np.maximum(time - 4.0, 0.0)
        noise = rng.standard_normal((3, time.size))
        swing = np.convolve(rng.standard_normal(time.size + 9), np.ones(10) / 10**0.5, "valid")
        ruts = 0.002 * np.sign(np.sin(2.0 * np.pi * turned / 0.05))
        rear = 0.2 + float(rears[k]) - spacing * np.sin(float(trims[k])) + ruts
        values = (
            [f"pull_{k + 1}"] * time.size,
            time,
            turned,
            (1.0 - float(slip)) * turned + 2e-4 * noise[0],
            2.0 * float(pull) * tight * (1.0 + 0.05 * swing) + 2.0 * noise[1],
            0.2 + 1e-3 * noise[2],
            rear + 1e-3 * noise[0],
            np.full(time.size, float(trims[k])),
        )
        for name, value in zip(columns, values, strict=True):
            columns[name] += list(value)
    return columns


def track(folder: Path) -> dict[str, str]:
    """Seven pulls of a tracked robot on sand, at 20 Hz."""
    case = read_case(folder / "model.toml")
    slips = np.asarray([0.03, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8])
    found = simulate_log(case, slips, 0.5 * 130.0 * 9.81, 0.6, np.random.default_rng(1))
    rounded = {k: v if k == "run" else np.asarray(v, float).round(5) for k, v in found.items()}
    return {"log.csv": csv_text(rounded)}


EXAMPLES = (campaign, log, sensor_wheel, climb, wheel_leg, track)


def run() -> None:
    """Write the examples."""
    for example in EXAMPLES:
        name = example.__name__.replace("_", "-")
        if name in (sys.argv[1:] or [name]):
            for file, text in example(FOLDER / name).items():
                (FOLDER / name / file).write_text(text)


if __name__ == "__main__":
    run()
