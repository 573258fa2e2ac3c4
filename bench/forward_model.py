"""The forward model: accuracy against adaptive quadrature, throughput; seconds of commands."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from conftest import input_box, solved
from reference import equilibrium
from runner import ROOT, Bench, Row, Sample, markdown, member, one_case, table

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import (
    ExitAngle,
    LinearWheel,
    Midstance,
    Model,
    Operating,
    SlipSinkage,
    Wheel,
    identify,
    simulate,
    soil,
)
from soilml.config.case import Case
from soilml.gap import gap
from soilml.io.table import Table
from soilml.processes import usable_cores
from soilml.systems.tracked_robot.robot import WANG2018
from training.dataset import read_dataset
from training.spec import read_spec
from training.train import train

#: Operating points of a call, of the input box, and of the scalar loop; runs of each.
ROWS, BOX_ROWS, BASELINE_ROWS, REPEATS = 200_000, 16_384, 40, 3
ACCURACY_ROWS, QUICK_ROWS = 1024, 96
COLD = """
import time; t = time.perf_counter()
from soilml.onboard.estimator import Estimator
e = Estimator.load({path!r}); e(slip=0.3, torque=3.0, load=60.0)
t = time.perf_counter() - t
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(t, int(status["VmRSS"].split()[0]) / 1024)
"""
READINGS, MANY_READINGS = 64, 208  # Rows that commands analyse
TRAINED = 96_000  # Rows that training learns from, those of the demonstration
ABOUT_ACCURACY = (
    "Relative error against adaptive quadrature and bracketing (`tests/reference.py`). Goal: 1e-6. "
    "The input box is c 0 to 6 kPa, phi 15 to 50 deg, K 2 to 60 mm, n 0.4 to 1.6 and k 4e4 to 1e7 "
    "N/m^(n+2). Loads are 5 to 1000 N, r is 0.04 to 0.5 m and b 0.02 to 0.4 m."
)
ABOUT_SPEED = (
    f"Solutions of one core in a second, {ROWS:,} operating points in a call, where nothing else "
    f"is said; the best of {REPEATS} runs, all cases in turn. The wheel has r 0.15 m and b 0.12 m "
    "and stands on soils of the recipe `wheel`; it drives where nothing else is said."
)
ABOUT_COMMANDS = "The best of several calls in one run, on the machine named above."


def accuracy_cases(sample: Sample) -> list[Row]:
    """Driving and braking."""
    rows = QUICK_ROWS if sample.quick else ACCURACY_ROWS
    signs = {"driving, 0 to 0.95": 1.0, "braking, -0.9 to 0": -1.0}
    return [{"slip": label, "sign": sign, "rows": rows} for label, sign in signs.items()]


def accuracy(case: Row) -> list[Row]:
    """Relative errors at operating points of the input box."""
    box = input_box(case["rows"], seed=123)
    box["slip"] = case["sign"] * np.abs(box["slip"])
    force, found = solved(box), []
    for i in np.flatnonzero(force.status == 0)[::3]:
        row = {name: values[i] for name, values in box.items()}
        entry, pull, torque = equilibrium(row, near=force.entry_angle[i])
        found.append(
            {
                "entry": abs(force.entry_angle[i] / entry - 1.0),
                "torque": abs(force.torque[i] / torque - 1.0),
                "pull": abs(force.drawbar_pull[i] - pull) / row["load"],
            }
        )
    return found


def accuracy_table(rows: list[Row]) -> str:
    """Largest and median errors."""

    def error(name: str, of=max):  # type: ignore[no-untyped-def]
        return lambda own: f"{of([row[name] for row in own]):.1e}"

    columns = {"rows": len, "entry angle, maximum": error("entry")}
    columns |= {"torque, maximum": error("torque")}
    columns |= {"drawbar pull / load, maximum": error("pull")}
    columns |= {"torque, median": error("torque", np.median)}
    return table(rows, {"slip": "slip"}, columns)


def speed(case: Row) -> list[Row]:
    """Solutions per second, beside scalar quadrature."""
    rows, rng = ROWS // 50 if case["quick"] else ROWS, np.random.default_rng(0)
    sand = soil(
        "wong1989/dry_sand",
        cohesion=rng.uniform(0.0, 3000.0, rows),
        friction_angle=rng.uniform(0.44, 0.79, rows),
        shear_modulus=rng.uniform(0.005, 0.03, rows),
    )
    load, slip = rng.uniform(30.0, 120.0, rows), rng.uniform(0.05, 0.6, rows)
    wheel, box = Model(Wheel(radius=0.15, width=0.12)), input_box(BOX_ROWS, seed=123)
    box["slip"] = np.abs(box["slip"])
    columns = vars(sand) | {"radius": 0.15, "width": 0.12, "slip": slip, "load": load}

    def row_by_row() -> None:
        for i in range(BASELINE_ROWS):
            row = {name: np.take(value, i) for name, value in columns.items() if np.ndim(value)}
            equilibrium(columns | {name: float(value) for name, value in row.items()})

    def by(model: Model, loads: np.ndarray = load, sign: float = 1.0) -> Callable[[], object]:
        return lambda: model(sand, Operating(slip=sign * slip, load=loads))

    foot = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
    calls: dict[str, tuple[Callable[[], object], int]] = {
        "adaptive quadrature and bracketing, row by row (scipy)": (row_by_row, BASELINE_ROWS),
        "rigid wheel, driving": (by(wheel), rows),
        "the same, over the whole input box of the accuracy table, with rows that are too heavy": (
            lambda: solved(box), BOX_ROWS,
        ),
        "rigid wheel, driving, two effects": (
            by(wheel + SlipSinkage(n1=0.4) + ExitAngle(kappa=0.1)), rows,
        ),
        "rigid wheel, braking": (by(wheel, sign=-1.0), rows),
        "linear-stress wheel (closed form)": (
            by(Model(LinearWheel(radius=0.15, width=0.12))), rows,
        ),
        "foot of a wheel-leg": (by(Model(foot), load / 10.0), rows),
        "flexible track": (by(Model(WANG2018.track), load + 380.0), rows),
    }  # fmt: skip
    best = dict.fromkeys(calls, np.inf)
    for _ in range(1 if case["quick"] else REPEATS):  # in turn, so that all see the same machine
        for label, (call, _) in calls.items():
            best[label] = min(best[label], seconds_of(call, 1))
    return [{"case": label, "rate": count / best[label]} for label, (_, count) in calls.items()]


def speed_table(rows: list[Row]) -> str:
    """Solutions per second."""
    scalar = rows[0]["rate"]
    lines = [(r["case"], f"{r['rate']:,.0f}", f"{r['rate'] / scalar:,.0f}") for r in rows]
    return markdown(("case", "solutions per second, one core", "ratio to the scalar loop"), lines)


def seconds_of(call: Callable[[], object], repeats: int = 5) -> float:
    """Seconds of the fastest of several calls."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times)


def _generation() -> str:
    recipe = read_recipe("wheel").sized(100_000)
    with tempfile.TemporaryDirectory() as folder:
        seconds = seconds_of(lambda: generate(recipe, Path(folder) / "data.parquet"), 2)
    return f"{100_000 / seconds:,.0f} rows / s, {usable_cores()} cores"


def _start(*arguments: str) -> str:
    command = [sys.executable, "-m", "soilml", *arguments]
    seconds = seconds_of(lambda: subprocess.run(command, capture_output=True, check=False), 15)
    return f"{seconds:.2f} s"


def _first_estimate() -> str:
    """From import to the first estimate, load, checksums and self-test included."""
    command = [sys.executable, "-c", COLD.format(path=str(ROOT / "exported" / "wheel.onnx"))]
    done = [
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        for _ in range(5)
    ]
    seconds, megabytes = np.min(np.asarray(done, float), axis=0)
    return f"{seconds:.3f} s, {megabytes:.0f} MB resident"


@cache
def measured_rows(count: int = READINGS) -> tuple[Case, Table]:
    """The case of the recipe `wheel`, and readings of torque and sinkage on one soil."""
    case, rng = read_recipe("wheel").case, np.random.default_rng(1)
    slip, load = rng.uniform(0.05, 0.6, count), np.repeat([35.0, 60.0, 85.0, 110.0], count // 4)
    true = case.with_values({"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012})
    rows = simulate(true, slip, load, seed=1)
    kept = ("slip", "load_N", "torque_Nm", "sinkage_m")
    return case, Table({"run": load} | {name: rows[name] for name in kept})


def _identified(method: str) -> str:
    case, rows = measured_rows()
    return f"{1e3 * seconds_of(lambda: identify(case, rows, method=method), 3):.0f} ms"


def _gap(count: int = READINGS) -> str:
    case, rows = measured_rows(count)
    return f"{seconds_of(lambda: gap(case, rows), 2):.1f} s"


def _training() -> str:
    """Wall and processor time, that of worker processes included."""
    spec = read_spec("fused")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "data.parquet"
        generate(read_recipe("wheel").sized(TRAINED), file)
        begun, began = time.perf_counter(), os.times()
        train(spec, read_dataset(file, spec.features, spec.targets))
        spent, ended = time.perf_counter() - begun, os.times()
    return f"{spent:.0f} s, {sum(ended[:4]) - sum(began[:4]):.0f} s of processors"


#: Commands and calls: goal, and the measurement in words.
CALLS: dict[str, tuple[str, Callable[[], str]]] = {
    "`soilml generate wheel`, a file": ("", _generation),
    f"`soilml train fused`, {TRAINED:,} rows": ("30 s", _training),
    "`soilml --help`": ("0.15 s", lambda: _start("--help")),
    "an error of usage": ("0.15 s", lambda: _start("estimate", "--nonsense")),
    "`identify` 64 rows, nonlinear least squares": ("50 ms", lambda: _identified("nonlinear")),
    "`identify` 64 rows, posterior": ("1000 ms", lambda: _identified("posterior")),
    "`identify` 64 rows, averaged": ("1000 ms", lambda: _identified("averaged")),
    "`gap` 64 rows of 2 channels, nothing hidden": ("1 s", _gap),
    "`gap` 208 rows of 2 channels, nothing hidden": ("3 s", lambda: _gap(MANY_READINGS)),
    "from import to the first estimate": ("0.2 s", _first_estimate),
}


ACCURACY = Bench(
    "accuracy", "Accuracy of the rigid wheel", ABOUT_ACCURACY, accuracy_cases, accuracy,
    accuracy_table,
)  # fmt: skip
SPEED = Bench(
    "speed", "Speed of the forward model", ABOUT_SPEED, one_case, speed, speed_table, timed=True
)
COMMANDS = Bench(
    "commands",
    "Seconds of commands and calls",
    ABOUT_COMMANDS,
    lambda sample: [{"what": name, "goal": goal} for name, (goal, _) in CALLS.items()],
    lambda case: {"measured": CALLS[case["what"]][1]()},
    lambda rows: table(
        rows, {"what": "what"}, {name: member(name) for name in ("measured", "goal")}
    ),
    timed=True,
)
