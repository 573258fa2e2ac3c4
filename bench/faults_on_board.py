"""Faults that a released file flags as flown.

Beside the flag of the answer, whose model has errors, the fault detector `Estimate.disagrees`, with
sensors of usual errors and with exact ones.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from faults import Fault, Readings, definitions, faults, simulate
from flags import LOAD, SLIP, add_noise, select_rows, shuffled_conditions
from runner import Bench, Row, Sample, markdown
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
SETS, QUICK_SETS, ROWS, SEED = 100, 6, 16, 31
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


def lines(case: Case, estimator: Estimator, sets: int) -> Iterator[tuple[str, Readings, Floats]]:
    """Name, readings (sets, rows) and soils (sets, 3) of each line; the soils are the same."""
    rng = np.random.default_rng(SEED)
    truth = np.stack([case.prior[name].at(rng.random(sets)) for name in SHEAR], axis=1)
    order = shuffled_conditions(sets, SEED)[:, :ROWS]
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
        drives = simulate_world(world, sets, ROWS, SEED)
        yield world.name, drives.readings, drives.truth


def cases(sample: Sample) -> list[Row]:
    """One file, with torque only and with all channels."""
    sets = QUICK_SETS if sample.quick else SETS
    return [{"file": "wheel", "channels": n, "sets": sets} for n in (3, 5)]


def flagged(asked: Row) -> list[Row]:
    """Each line: shares flagged by the answer and by both detectors; coverage of the answer."""
    case, estimator = read_recipe("wheel").case, Estimator.load(asked["file"])
    exact = estimator.on(**dict.fromkeys(SENSOR_ERROR_INPUTS, 0.0))
    return [
        {"fault": name, **rates((estimator, exact), readings, truth, asked["channels"])}
        for name, readings, truth in lines(case, estimator, asked["sets"])
    ]


def rates(
    estimators: tuple[Estimator, Estimator], r: Readings, truth: Floats, channels: int
) -> Row:
    """Shares of the sets that are flagged; of those that are answered, in which intervals hold."""
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
    known = values[~np.isnan(values[:, 3])][:, 3:]
    covered = known.mean(axis=0).tolist() if len(known) else None
    return {"flagged": values[:, :3].mean(axis=0).tolist(), "covered": covered}


def tables(rows: list[Row]) -> str:
    """Faults by what flags them, with torque only and with all channels."""
    texts = []
    for n, what in ((3, "torque only"), (5, "all channels")):
        body = []
        for row in (r for r in rows if r["channels"] == n):
            covered = row["covered"]
            held = "-" if covered is None else " ".join(f"{100.0 * c:.0f}" for c in covered)
            body.append([row["fault"], *(f"{100.0 * f:.0f}" for f in row["flagged"]), held])
        head = [
            f"fault, {ROWS} rows, {what}",
            "answer",
            "detector",
            "exact sensors",
            "covered c phi K",
        ]
        texts.append(markdown(head, body))
    return "\n\n".join(texts)


def cost_cases(sample: Sample) -> list[Row]:
    """Files with a detector."""
    return [{"file": name} for name in ("wheel", "wheel_small")]


def cost(asked: Row) -> Row:
    """Least times of a call with and without the detector, measured in turn, ms."""
    estimator, times = Estimator.load(asked["file"]), np.zeros((TIMED, 2))
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
    return {"without": without, "with": both}


def cost_tables(rows: list[Row]) -> str:
    """Times and their ratio."""
    body = [
        [r["file"], f"{r['without']:.2f}", f"{r['with']:.2f}", f"{r['with'] / r['without']:.2f}"]
        for r in rows
    ]
    return markdown(["file", "ms without the detector", "ms with it", "ratio"], body)


ON_BOARD = Bench(
    "faults_on_board",
    "Faults that a file flags as flown",
    f"{SETS} sets of {ROWS} rows of the reference wheel with 2 % torque noise; shares in %. "
    "*Answer*: the flag of the estimate, whose model has errors; *detector*: `disagrees`, with "
    "usual errors of sensors; *exact sensors*: with none. Covered: 90 % intervals of the answer.",
    cases,
    flagged,
    tables,
)
DETECTOR_COST = Bench(
    "detector_cost",
    "What the fault detector costs",
    f"Least of {TIMED} calls of {ROWS} rows, with and without it in turn.",
    cost_cases,
    cost,
    cost_tables,
    timed=True,
)
