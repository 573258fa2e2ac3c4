"""The first page of BENCHMARKS.md: a dozen figures with their goals, measured in one run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import board
import former
import numpy as np
import physics
from conftest import input_box, solved

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator, Model, Operating, Wheel, identify, read_table, soil
from soilml.config.case import Case
from soilml.gap import gap
from soilml.identification.trained_estimator import for_simulated_case
from soilml.io.table import Table
from soilml.processes import usable_cores

ROOT = Path(__file__).parents[1]
REPEATS = 5
ROWS = 100_000
READINGS = 64


@dataclass(frozen=True)
class Figure:
    """A line of the page; `measure` returns the figure in words."""

    name: str
    goal: str
    measure: Callable[[], str]


def text() -> str:
    """The table, and beside version 0.1.0."""
    lines = ["| what | measured | goal |", "|---|---:|---:|"]
    for figure in FIGURES:
        print(f"  {figure.name}", file=sys.stderr)
        lines.append(f"| {figure.name} | {figure.measure()} | {figure.goal} |")
    return "\n".join([*lines, "", former.table()])


def _best(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of several calls."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times)


def _solutions(sign: float) -> str:
    rng = np.random.default_rng(0)
    sand = soil(
        "wong1989/dry_sand",
        cohesion=rng.uniform(0.0, 3000.0, ROWS),
        friction_angle=rng.uniform(0.44, 0.79, ROWS),
        shear_modulus=rng.uniform(0.005, 0.03, ROWS),
    )
    at = Operating(slip=sign * rng.uniform(0.05, 0.6, ROWS), load=rng.uniform(30.0, 120.0, ROWS))
    wheel = Model(Wheel(radius=0.15, width=0.12))
    return f"{ROWS / _best(lambda: wheel(sand, at)):,.0f} / s"


def _box() -> str:
    box = input_box(physics.BOX_ROWS, seed=123)
    box["slip"] = np.abs(box["slip"])
    return f"{physics.BOX_ROWS / _best(lambda: solved(box)):,.0f} / s"


def _generation() -> str:
    recipe = read_recipe("wheel").sized(ROWS)
    with tempfile.TemporaryDirectory() as folder:
        seconds = _best(lambda: generate(recipe, Path(folder) / "data.parquet"), 2)
    return f"{ROWS / seconds:,.0f} rows / s, {usable_cores()} cores"


def _start(*arguments: str) -> str:
    command = [sys.executable, "-m", "soilml", *arguments]
    seconds = _best(lambda: subprocess.run(command, capture_output=True, check=False), 15)
    return f"{seconds:.2f} s"


def _identification(method: str, unit: float, name: str) -> str:
    case, table = _runs()
    return f"{_best(lambda: identify(case, table, method=method), 3) / unit:.2g} {name}"


def _gap() -> str:
    case, table = _runs()
    return f"{_best(lambda: gap(case, table), 2):.1f} s"


def _runs() -> tuple[Case, Table]:
    """The case of the recipe `wheel`, and readings of torque, pull and sinkage on one soil."""
    case = read_recipe("wheel").case
    rng = np.random.default_rng(1)
    slip, load = rng.uniform(0.05, 0.6, READINGS), np.repeat([35.0, 60.0, 85.0, 110.0], 16)
    true = case.with_values({"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012})
    force = true.model(true.soil, Operating(slip=slip, load=load))
    torque = force.torque * (1.0 + 0.02 * rng.standard_normal(READINGS))
    sinkage = force.sinkage + 0.0005 * rng.standard_normal(READINGS)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "runs.csv"
        rows = zip(load, slip, load, torque, sinkage, strict=True)
        lines = [f"{run:g},{s},{w},{t},{z}" for run, s, w, t, z in rows]
        file.write_text("\n".join(["run,slip,load_N,torque_Nm,sinkage_m", *lines]))
        return case, read_table(file)


def _set_of_16(file: str) -> str:
    estimator = for_simulated_case(
        Estimator.load(ROOT / "exported" / file), read_recipe("wheel").case
    )
    return f"{board.set_in_runtime(estimator)[0]:.0f} us"


def _one_reading() -> str:
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx")
    feed = {n: np.asarray([v], np.float32) for n, v in board.reading().items()}
    return f"{board.timed(lambda: estimator.session.run(board.OUTPUTS, feed))[0]:.0f} us"


FIGURES = (
    Figure("equilibria of a driving wheel, one core", "800,000 / s", lambda: _solutions(1.0)),
    Figure("the same over the whole input box, too heavy rows included", "500,000 / s", _box),
    Figure("equilibria of a braking wheel, one core", "200,000 / s", lambda: _solutions(-1.0)),
    Figure("`soilml generate wheel`, a file", "", _generation),
    Figure("`soilml --help`", "0.15 s", lambda: _start("--help")),
    Figure("an error of usage", "0.15 s", lambda: _start("estimate", "--nonsense")),
    Figure(
        f"`identify` {READINGS} rows, nonlinear least squares",
        "50 ms",
        lambda: _identification("nonlinear", 1e-3, "ms"),
    ),
    Figure(
        f"`identify` {READINGS} rows, posterior",
        "1 s",
        lambda: _identification("posterior", 1.0, "s"),
    ),
    Figure(f"`gap` {READINGS} rows of 2 channels, nothing hidden", "1 s", _gap),
    Figure("one reading on board, onnxruntime, `wheel.onnx`", "60 us", _one_reading),
    Figure(
        "set of 16 on board, onnxruntime, `wheel.onnx`", "150 us", lambda: _set_of_16("wheel.onnx")
    ),
    Figure(
        "set of 16 on board, onnxruntime, `any_wheel.onnx`",
        "350 us",
        lambda: _set_of_16("any_wheel.onnx"),
    ),
)
