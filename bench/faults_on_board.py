"""Faults that a released file flags as flown: by its answer, and by the detector beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, percent, table
from wrong_worlds import World
from wrong_worlds import simulate as simulate_world

from datagen.recipe import read_recipe
from soilml import Estimator, Operating
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.onboard.set_contract import SENSOR_ERROR_INPUTS
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.quantities import SHEAR, column

Floats = np.ndarray[Any, np.dtype[np.float64]]
#: slip, load (N), torque (N m), sinkage (m), drawbar_pull (N): arrays of one shape.
Readings = dict[str, Floats]

#: Operating conditions: six slips at six loads (N); sets have the first rows of a shuffle of them.
SLIP = np.repeat([0.08, 0.14, 0.21, 0.29, 0.38, 0.48], 6)
LOAD = np.tile([40.0, 52.0, 65.0, 79.0, 94.0, 110.0], 6)
#: Operating conditions that some effects need: speed (m/s), pass in a rut, slip angle (rad).
EFFECT_CONDITIONS = {"speed": 0.2, "pass_number": 2.0, "slip_angle": 0.2}
G = 9.80665
#: Readings of another definition or unit, and of sensors that are off: channel, and what is read.
READ_AS: dict[str, tuple[str, Callable[[Floats], Floats]]] = {
    "torque in lbf ft": ("torque", lambda x: 1.356 * x),
    "torque halved": ("torque", lambda x: 0.5 * x),
    "slip read as s / (1 - s)": ("slip", lambda x: x / (1.0 - x)),
    "torque in N mm": ("torque", lambda x: 1e3 * x),
    "torque in N cm": ("torque", lambda x: 1e2 * x),
    "torque in kN m": ("torque", lambda x: 1e-3 * x),
    "torque in kgf m": ("torque", lambda x: x / G),
    "load in kg": ("load", lambda x: x / G),
    "load in g": ("load", lambda x: 1e3 * x / G),
    "load in kN": ("load", lambda x: 1e-3 * x),
    "slip in percent": ("slip", lambda x: 100.0 * x),
    "sinkage in mm": ("sinkage", lambda x: 1e3 * x),
    "sinkage in cm": ("sinkage", lambda x: 1e2 * x),
    "slip read as 1.1 s": ("slip", lambda x: 1.1 * x),
    "slip read as s + 0.1": ("slip", lambda x: x + 0.1),
    "torque + 0.1 N m": ("torque", lambda x: x + 0.1),
    "torque + 0.2 N m": ("torque", lambda x: x + 0.2),
}
#: True radius or width over that of the model file.
WHEEL_FACTORS = (0.5, 1.0 / 1.5, 0.8, 1.25, 1.5, 2.0)

#: Soils of each line, rows of each set, and the seed of both.
SETS, ROWS, SEED, QUICK_SETS = 100, 16, 31, 4
#: What no flag of the answer shows, simulated by the reference wheel of the blind sets.
WORLDS = (
    World("radius 0.18 m for 0.15 m", radius=1.2),
    World("bearing pressure a quarter", bearing=0.25),
    World("shear curve with a peak of 30 %", mechanism=("shear-softening/peak-and-decay", 0.3)),
)
CHANNELS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
#: Flags of a set, as columns.
FLAGS = ("answer", "detector", "detector, exact sensors")
EXACT_SENSORS, USUAL_SENSORS = "no fault, exact sensors", "no fault, usual sensor errors"
ABOUT = (
    f"`wheel.onnx` as flown, on {SETS} soils a line, {ROWS} rows each: sets flagged by the answer, "
    "whose model has errors; by the fault detector beside it (`Estimate.disagrees`), with sensors "
    "of usual errors and with exact ones, in per cent; and coverage of the 90 % intervals of the "
    "answer."
)


def with_usual_sensor_errors(r: Readings, estimator: Estimator, seed: int) -> Readings:
    """Readings (sets, rows) with the errors of sensors that the file takes as usual."""
    assert estimator.sets is not None
    std, rng = estimator.sets.common_errors, np.random.default_rng(seed)
    drawn = {n: std[n] * rng.standard_normal((len(r["slip"]), 1)) for n in SENSOR_ERROR_INPUTS}
    return {
        "slip": r["slip"] + drawn["slip_bias"],
        "load": r["load"] * (1.0 + drawn["load_gain"]),
        "torque": r["torque"] * (1.0 + drawn["torque_gain"]),
        "sinkage": r["sinkage"] + drawn["sinkage_bias"],
        "drawbar_pull": r["drawbar_pull"] + drawn["drawbar_pull_bias"],
    }


@cache
def worlds() -> dict[str, Case]:
    """True cases by what differs from the model file: the wheel, or an effect that it lacks.

    Each effect that applies to the gear has twice its reference size, or the bound of that.
    """
    case, found = read_recipe("wheel").case, {}
    gear: Any = case.model.gear
    for key in ("radius", "width"):
        for factor in WHEEL_FACTORS:
            true = case.with_values({f"gear.{key}": factor * getattr(gear, key)})
            found[f"{key} x {factor:.2f}"] = true
    for name, cls in EFFECTS.items():
        if cls.applies_to(gear) and name != "torque-offset":
            key, bound = cls.about.size, declared(cls)[cls.about.size]
            size = float(np.clip(2.0 * cls.about.reference[key], bound.lower, bound.upper))
            effect = cls(**{**cls.about.reference, key: size})
            found[f"{name}, {key} {size:g}"] = replace(case, model=case.model + effect)
    return found


def cases(sample: Sample) -> list[Row]:
    """Sound sets, each fault and each world; the soils are the same."""
    sets = QUICK_SETS if sample.quick else SETS
    names = [EXACT_SENSORS, USUAL_SENSORS, *READ_AS, *worlds(), *(world.name for world in WORLDS)]
    return [{"fault": name, "sets": sets} for name in (names[:4] if sample.quick else names)]


def read(case: Row, estimator: Estimator) -> tuple[Readings, Floats]:
    """Readings (sets, rows) and soils (sets, 3) of a line."""
    name, sets, model = case["fault"], case["sets"], read_recipe("wheel").case
    for world in WORLDS:
        if world.name == name:
            drives = simulate_world(world, sets, ROWS, SEED)
            return drives.readings, drives.truth
    rng = np.random.default_rng(SEED)
    truth = np.stack([model.prior[key].at(rng.random(sets)) for key in SHEAR], axis=1)
    found = simulate(worlds().get(name, model), truth)
    rng = np.random.default_rng(SEED)
    std = {key: np.asarray(model.noise[column(key)].std(found[key])) for key in CHANNELS[2:]}
    found |= {key: found[key] + std[key] * rng.standard_normal(std[key].shape) for key in std}
    if name in READ_AS:
        channel, of = READ_AS[name]
        found[channel] = of(found[channel])
    order = shuffled_conditions(sets)
    found = {key: np.take_along_axis(values, order, axis=1) for key, values in found.items()}
    if name == USUAL_SENSORS:
        found = with_usual_sensor_errors(found, estimator, SEED)
    return found, truth


def simulate(case: Case, theta: Floats) -> Readings:
    """True readings (sets, conditions) on soils (sets, 3)."""
    own = case.with_values(dict(zip(case.prior, theta.T[:, :, None], strict=True)))
    operating = Operating(slip=SLIP, load=LOAD, **EFFECT_CONDITIONS)  # type: ignore[arg-type]
    force = own.model(own.soil, operating)
    shape = np.shape(force.torque)
    given = {"slip": np.broadcast_to(SLIP, shape), "load": np.broadcast_to(LOAD, shape)}
    return given | {key: np.asarray(getattr(force, key)) for key in CHANNELS[2:]}


def shuffled_conditions(sets: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Order (sets, rows) of rows: every slip once, then every slip at another load, ..."""
    rng = np.random.default_rng(SEED)
    loads, slips = (rng.permuted(np.tile(np.arange(6), (sets, 6, 1)), axis=2) for _ in range(2))
    chosen = np.take_along_axis(loads.swapaxes(1, 2), slips, axis=2)  # (sets, round, position)
    return (6 * slips + chosen).reshape(sets, 36)[:, :ROWS]


def flagged(case: Row) -> list[Row]:
    """Shares of sets, by torque and by all channels: flagged by answer and detectors, covered."""
    estimator, rows = Estimator.load(ROOT / "exported" / "wheel.onnx"), []
    files = (estimator, estimator.on(**dict.fromkeys(SENSOR_ERROR_INPUTS, 0.0)))
    readings, truth = read(case, estimator)
    for count, channels in ((3, "torque"), (5, "all channels")):
        flags, covered = [], []
        for i, soil in enumerate(truth):
            own = {name: readings[name][i] for name in CHANNELS[:count]}
            try:
                answer, exact = (file.run(**own) for file in files)
            except InputError:
                flags.append((True, True, True))
                continue
            flags.append((not answer.in_range, bool(answer.disagrees), bool(exact.disagrees)))
            covered.append((soil >= answer.low) & (soil <= answer.high))
        shares = dict(zip(FLAGS, np.mean(flags, axis=0), strict=True))
        held = {"covered": np.mean(covered, axis=0)} if covered else {}
        rows.append({"channels": channels} | shares | held)
    return rows


def tables(rows: list[Row]) -> str:
    """A line for each fault, with torque only and with all channels."""
    columns = {name: percent(name) for name in FLAGS} | {"covered: c, phi, K": percent("covered")}
    return table(rows, {"fault": "fault", "channels": "channels"}, columns)


FAULTS_ON_BOARD = Bench(
    "faults-on-board", "Faults that a file flags as flown", ABOUT, cases, flagged, tables
)
