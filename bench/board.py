"""On board: latency of an estimate, size and parity of the released files."""

from __future__ import annotations

import time
from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, markdown

from datagen.recipe import read_recipe
from soilml import Estimator, Model, Operating, Wheel, soil
from soilml.identification.trained_estimator import for_simulated_case
from soilml.onboard.set_contract import MEMORY_OUTPUTS, SET_OUTPUTS, SET_PREFIX

CALLS, QUICK_CALLS = 4000, 80
OUTPUTS = ("mean", "std", "covariance", "in_range")
READING = {"slip": 0.3, "torque": 3.0, "load": 60.0}
ABOUT = (
    "Median and 99th percentile (p99) in microseconds, one thread. Goals: 60 us for one reading, "
    "0.5 MB per file; none for sets, whose time is that of the graph's nodes "
    "([decision 37](../../docs/decisions/0037-shortcuts-in-the-graph.md)). *Parity*: largest "
    "difference between the float32 file and the float64 estimator, over "
    "the standard deviation of the prior; goal: 1e-4."
)


def readings() -> dict[str, np.ndarray]:
    """Sixteen readings of one soil."""
    slip, load = np.linspace(0.08, 0.55, 16), np.tile([40.0, 75.0, 110.0, 90.0], 4)
    at = Operating(slip=slip, load=load)
    force = Model(Wheel(radius=0.15, width=0.12))(soil("wong1989/dry_sand"), at)
    return {"slip": slip, "load": load, "torque": force.torque}


@cache
def estimator_of(name: str) -> Estimator:
    """A released file, for the wheel of the recipe."""
    file = Estimator.load(ROOT / "exported" / f"{name}.onnx")
    return for_simulated_case(file, read_recipe("wheel").case)


def timed(call: Any, count: int = CALLS) -> tuple[float, float]:
    """Median and p99 (us) of a call."""
    taken = np.empty(count)
    for _ in range(50):
        call()
    for i in range(count):
        started = time.perf_counter()
        call()
        taken[i] = time.perf_counter() - started
    return float(np.median(taken) * 1e6), float(np.quantile(taken, 0.99) * 1e6)


def latency_cases(sample: Sample) -> list[Row]:
    """Released files for the recipe's wheel, and for any."""
    calls = QUICK_CALLS if sample.quick else CALLS
    files = sorted(file.stem for file in (ROOT / "exported").glob("*wheel*.onnx"))
    return [{"file": name, "calls": calls} for name in files]


def latency(case: Row) -> Row:
    """Median and p99 (us): onnxruntime, and through `Estimator`; sets of 16."""
    estimator, calls = estimator_of(case["file"]), case["calls"]
    many, some = readings(), max(calls // 8, 10)
    found: Row = {
        "kB": (ROOT / "exported" / f"{case['file']}.onnx").stat().st_size / 1e3,
        "parity": estimator.metadata.get("parity", ""),
        "Estimator": timed(lambda: estimator(**READING), calls),
        "run": timed(lambda: estimator.run(**many), some),
    }
    if not (estimator.sets and estimator.sets.sets_only):
        feed = {n: np.asarray([v], np.float32) for n, v in READING.items()}
        found["onnxruntime"] = timed(lambda: estimator.session.run(OUTPUTS, feed), calls)
    if estimator.sets is not None:
        names = [*(SET_PREFIX + name for name in SET_OUTPUTS), *MEMORY_OUTPUTS]
        feed = estimator.sets.feed(estimator.sets.rows(many), estimator.sets.start())
        found["set"] = timed(lambda: estimator.session.run(names, feed), some)
        _, memory = estimator.step(estimator.start(), **many)
        found["step"] = timed(lambda: estimator.step(memory, **READING), some)
    return found


def latency_table(rows: list[Row]) -> str:
    """A line for each file."""

    def us(row: Row, key: str, which: int = 0) -> str:
        return f"{row[key][which]:.0f}" if key in row else ""

    head = (
        "file", "kB", "parity", "1 reading, onnxruntime", "p99", "1 reading, `Estimator`", "p99",
        "16 readings, onnxruntime", "16 readings, `run`", "1 more reading, `step`",
    )  # fmt: skip
    lines = [
        (
            f"{r['file']}.onnx",
            f"{r['kB']:.0f}",
            r["parity"],
            *(us(r, key, i) for key in ("onnxruntime", "Estimator") for i in (0, 1)),
            *(us(r, key) for key in ("set", "run", "step")),
        )
        for r in rows
    ]
    return markdown(head, lines)


LATENCY = Bench(
    "board", "Latency on board", ABOUT, latency_cases, latency, latency_table, timed=True
)
