"""Learned estimators beside the Bayes limit, and how long training takes."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from board import estimator_of
from runner import Bench, Row, Sample, markdown, one_case

from datagen.generate import generate
from datagen.recipe import read_recipe
from training.benchmark.acceptance import goals
from training.benchmark.report import LEGEND, format_goals, format_tables
from training.benchmark.suite import benchmark
from training.dataset import read_dataset
from training.spec import read_any_wheel_spec, read_spec
from training.train import train, train_any_wheel

FILES = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")
#: Rows of the data of the recipe `wheel`, whose own number is the first; rows of a quick look.
ROWS, QUICK_ROWS = (96_000, 192_000, 400_000), 4_000
ABOUT_COMPARISON = (
    "Written by `soilml compare`. The reference wheel follows the recipe `benchmark`: c 0 to 3 "
    "kPa, phi 25 to 45 deg, K 5 to 30 mm, slip 0.05 to 0.6, load 30 to 120 N. Torque noise is 2 %, "
    "and the bearing parameters are known. A single reading does not determine three parameters: "
    "all methods stay near the prior there, with correspondingly wide intervals."
)
ABOUT_TIME = (
    "`soilml train fused` on rows of the recipe `wheel`, and `soilml train any_wheel`. Goals: 30 s "
    "for the 96 000 rows of the demonstration, 120 s for `any_wheel`, and cost that grows linearly "
    "with the number of rows. *Processor time* is that of all processes; where other programs "
    "run, wall time is longer."
)


def comparison(case: Row) -> Row:
    """Released models and analytic methods on the fixed benchmark, with acceptance goals."""
    results = benchmark({name: estimator_of(name) for name in FILES})
    return {"text": f"{format_goals(goals(results))}\n\n{format_tables(results)}"}


def comparison_table(rows: list[Row]) -> str:
    """As the command writes it."""
    legend = " ".join(f"`{term}`: {meaning}" for term, meaning in LEGEND)
    return f"{legend}\n\n```\n{rows[0]['text']}\n```"


class Stopwatch:
    """Wall and processor time of each stage, those of worker processes included."""

    def __init__(self, stage: str) -> None:
        self.stage, self.seconds = stage, {stage: (0.0, 0.0)}
        self.since = _now()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Count the time since the last call for the stage before, and go on with this one."""
        now, (wall, processor) = _now(), self.seconds[self.stage]
        spent = wall + now[0] - self.since[0], processor + now[1] - self.since[1]
        self.seconds[self.stage] = spent
        self.since, self.stage = now, stage.partition(" (")[0]
        self.seconds.setdefault(self.stage, (0.0, 0.0))


def _now() -> tuple[float, float]:
    times = os.times()
    own, children = times.user + times.system, times.children_user + times.children_system
    return time.perf_counter(), own + children


def time_cases(sample: Sample) -> list[Row]:
    """`fused` for each number of rows, and `any_wheel`."""
    rows = (QUICK_ROWS,) if sample.quick else ROWS
    return [{"rows": n} for n in rows] + ([] if sample.quick else [{"rows": 0}])


def training_time(case: Row) -> Row:
    """Wall and processor time of each stage."""
    watch = Stopwatch("reading the data")
    if not case["rows"]:
        train_any_wheel(read_any_wheel_spec("any_wheel"), watch)
        name = "any_wheel"
    else:
        spec, name = read_spec("fused"), f"fused, {case['rows']:,} rows"
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "data.parquet"
            generate(read_recipe("wheel").sized(case["rows"]), file)
            watch = Stopwatch("reading the data")
            data = read_dataset(file, spec.features, spec.targets)
            train(spec, data, watch)
    watch("all", 0, 0)
    stages = {stage: own for stage, own in watch.seconds.items() if stage != "all" and any(own)}
    return {"name": name, "stages": stages}


def time_table(rows: list[Row]) -> str:
    """Stages in rows, trainings in columns."""

    def cell(seconds: list[float] | None) -> str:
        return "" if seconds is None else f"{seconds[0]:.1f} ({seconds[1]:.1f})"

    stages = dict.fromkeys(stage for row in rows for stage in row["stages"])
    lines = [(stage, *(cell(row["stages"].get(stage)) for row in rows)) for stage in stages]
    totals = [[sum(part) for part in zip(*row["stages"].values(), strict=True)] for row in rows]
    lines.append(("all", *map(cell, totals)))
    return markdown(("wall time (processor time), s", *(row["name"] for row in rows)), lines)


COMPARISON = Bench(
    "comparison",
    "Estimators and analytic methods relative to the Bayes limit",
    ABOUT_COMPARISON,
    one_case,
    comparison,
    comparison_table,
)
TRAINING = Bench(
    "training", "Time of training", ABOUT_TIME, time_cases, training_time, time_table, timed=True
)
