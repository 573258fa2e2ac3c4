"""Faults that a released file flags as flown: `python bench/faults_on_board.py [FILE]`.

Beside the flag of the answer, whose model has errors, the fault detector `Estimate.disagrees`, with
sensors of usual errors and with exact ones.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from faults import Fault, Readings, definitions, faults, simulate
from flags import LOAD, SLIP, add_noise, select_rows, shuffled_conditions
from wrong_worlds import World
from wrong_worlds import simulate as simulate_world

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.onboard.set_contract import SENSOR_ERROR_INPUTS
from soilml.quantities import SHEAR

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Soils of each line, rows of each set, and the seed of both.
SETS, ROWS, SEED = 100, 16, 31
#: What no flag of the answer shows, simulated by the reference wheel of the blind sets.
WORLDS = (
    World("radius 0.18 m for 0.15 m", radius=1.2),
    World("bearing pressure a quarter", bearing=0.25),
    World("shear curve with a peak of 30 %", mechanism=("shear-softening/peak-and-decay", 0.3)),
)
CHANNELS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
TIMED = 300  # Calls of which the least time is taken, in turn


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


def lines(case: Case, estimator: Estimator) -> Iterator[tuple[str, Readings, Floats]]:
    """Name, readings (sets, rows) and soils (sets, 3) of each line; the soils are the same."""
    rng = np.random.default_rng(SEED)
    truth = np.stack([case.prior[name].at(rng.random(SETS)) for name in SHEAR], axis=1)
    order = shuffled_conditions(SETS, SEED)[:, :ROWS]
    for fault in (Fault("-", "no fault"), *definitions(), *faults(case)):
        true = simulate(fault.case(case), truth, SLIP, LOAD)
        read = select_rows(fault.report(add_noise(true, case, SEED)), fault, order)
        if fault.name == "no fault":
            yield "no fault, exact sensors", read, truth
            read = with_usual_sensor_errors(read, estimator, SEED)
            yield "no fault, usual sensor errors", read, truth
        else:
            yield fault.name, read, truth
    for world in WORLDS:
        drives = simulate_world(world, SETS, ROWS, SEED)
        yield world.name, drives.readings, drives.truth


def rates(
    estimators: tuple[Estimator, Estimator], r: Readings, truth: Floats, channels: int
) -> str:
    """Cells of a line: flagged by the answer, by both detectors; coverage of the answer."""
    found = []
    for i in range(len(truth)):
        rows = {name: r[name][i] for name in CHANNELS[:channels]}
        try:
            answer, exact = (one.run(**rows) for one in estimators)
        except InputError:
            found.append((True, True, True, np.nan, np.nan, np.nan))
            continue
        covered = np.where((truth[i] >= answer.low) & (truth[i] <= answer.high), 1.0, 0.0)
        found.append((not answer.in_range, bool(answer.disagrees), bool(exact.disagrees), *covered))
    values = np.asarray(found, float)
    shares = [f"{100.0 * share:.0f}" for share in values[:, :3].mean(axis=0)]
    known = values[~np.isnan(values[:, 3])]
    covered = " ".join(f"{100.0 * c:.0f}" for c in known[:, 3:].mean(axis=0)) if len(known) else "-"
    return f"{' | '.join(shares)} | {covered}"


def table(name: str) -> str:
    """Markdown of all faults, with torque only and with all channels."""
    case, estimator = read_recipe("wheel").case, Estimator.load(name)
    exact = estimator.on(**dict.fromkeys(SENSOR_ERROR_INPUTS, 0.0))
    head = "answer | detector | exact sensors | covered c phi K"
    found = [f"| fault, {ROWS} rows | {head} | {head} |", f"|---{'|---:' * 8}|"]
    for fault, readings, truth in lines(case, estimator):
        torque, every = (rates((estimator, exact), readings, truth, n) for n in (3, 5))
        found.append(f"| {fault} | {torque} | {every} |")
    return "\n".join(found)


def cost(name: str) -> str:
    """Least times of a call with and without the detector, measured in turn, and their ratio."""
    estimator, times = Estimator.load(name), np.zeros((TIMED, 2))
    sets = estimator.sets
    assert sets is not None
    rng = np.random.default_rng(SEED)
    slip, load = rng.uniform(0.08, 0.5, ROWS), rng.uniform(45.0, 105.0, ROWS)
    rows = {"slip": slip, "load": load, "torque": 0.06 * load * (1.0 - np.exp(-slip / 0.15))}
    for i in range(TIMED):
        start = time.perf_counter()
        sets.update(estimator.session, sets.rows(rows), estimator.start())
        middle = time.perf_counter()
        estimator.run(**rows)
        times[i] = middle - start, time.perf_counter() - middle
    without, both = 1e3 * times.min(axis=0)
    ratio = both / without
    return f"{name}: {without:.2f} ms without the detector, {both:.2f} ms with it, x {ratio:.2f}"


if __name__ == "__main__":
    for file in sys.argv[1:] or ["wheel"]:
        print(table(file))
        print()
        print(cost(file))
