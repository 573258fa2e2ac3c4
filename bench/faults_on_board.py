"""Faults that a released file flags as flown: by its answer, and by the detector beside it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from faults import (
    LOAD,
    SLIP,
    Fault,
    Readings,
    add_noise,
    definitions,
    faults,
    select_rows,
    shuffled_conditions,
    simulate,
)
from runner import ROOT, Bench, Row, Sample, percent, table
from wrong_worlds import World
from wrong_worlds import simulate as simulate_world

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.errors import InputError
from soilml.onboard.set_contract import SENSOR_ERROR_INPUTS
from soilml.quantities import SHEAR

Floats = np.ndarray[Any, np.dtype[np.float64]]

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
def studied() -> dict[str, Fault]:
    """All faults by name."""
    case = read_recipe("wheel").case
    return {fault.name: fault for fault in (*definitions(), *faults(case))}


def cases(sample: Sample) -> list[Row]:
    """Sound sets, each fault and each world; the soils are the same."""
    sets = QUICK_SETS if sample.quick else SETS
    names = [EXACT_SENSORS, USUAL_SENSORS, *studied(), *(world.name for world in WORLDS)]
    return [{"fault": name, "sets": sets} for name in (names[:4] if sample.quick else names)]


def read(case: Row, estimator: Estimator) -> tuple[Readings, Floats]:
    """Readings (sets, rows) and soils (sets, 3) of a line."""
    name, sets, model = case["fault"], case["sets"], read_recipe("wheel").case
    for world in WORLDS:
        if world.name == name:
            drives = simulate_world(world, sets, ROWS, SEED)
            return drives.readings, drives.truth
    rng, fault = np.random.default_rng(SEED), studied().get(name, Fault("no fault"))
    truth = np.stack([model.prior[key].at(rng.random(sets)) for key in SHEAR], axis=1)
    order = shuffled_conditions(sets, SEED)[:, :ROWS]
    true = simulate(fault.case(model), truth, SLIP, LOAD)
    found = select_rows(fault.report(add_noise(true, model, SEED)), order)
    if name == USUAL_SENSORS:
        found = with_usual_sensor_errors(found, estimator, SEED)
    return found, truth


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
