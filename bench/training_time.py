"""Time of `soilml train` by stage: for the packaged specs, and against the number of rows."""

from __future__ import annotations

import os
import time
from pathlib import Path

from datagen.generate import generate
from datagen.recipe import read_recipe
from training.dataset import read_dataset
from training.spec import read_any_wheel_spec, read_spec
from training.train import train, train_any_wheel

#: Rows of the data of the recipe `wheel`, whose own number is the first.
ROWS = (96_000, 192_000, 400_000)
ABOUT = (
    "`soilml train fused` on rows of the recipe `wheel`, and `soilml train any_wheel`. Goals: 30 s "
    "for the 96 000 rows of the demonstration, 120 s for `any_wheel`, and cost that grows linearly "
    "with the number of rows. *Processor time* is that of all processes; where other programs "
    "run, wall time is longer."
)


class Stopwatch:
    """Wall and processor time of each stage, those of worker processes included."""

    def __init__(self, stage: str) -> None:
        self.stage, self.seconds = stage, {stage: (0.0, 0.0)}
        self.since = _now()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Count the time since the last call for the stage before, and go on with this one."""
        now = _now()
        wall, processor = self.seconds[self.stage]
        self.seconds[self.stage] = (
            wall + now[0] - self.since[0],
            processor + now[1] - self.since[1],
        )
        self.since, self.stage = now, stage.partition(" (")[0]
        self.seconds.setdefault(self.stage, (0.0, 0.0))

    def total(self) -> tuple[float, float]:
        """Wall and processor time of all stages."""
        wall, processor = zip(*self.seconds.values(), strict=True)
        return sum(wall), sum(processor)


def _now() -> tuple[float, float]:
    times = os.times()
    own, children = times.user + times.system, times.children_user + times.children_system
    return time.perf_counter(), own + children


def table(folder: Path) -> str:
    """Stages in rows; `fused` for each number of rows, and `any_wheel`, in columns."""
    columns = {f"fused, {rows:,} rows": _fused(folder, rows) for rows in ROWS}
    columns["any_wheel"] = _any_wheel()
    stages = list(dict.fromkeys(stage for found in columns.values() for stage in found.seconds))
    lines = [
        "| wall time (processor time), s | " + " | ".join(columns) + " |",
        "|---|" + "---:|" * len(columns),
    ]
    for stage in stages:
        cells = [_cell(found.seconds.get(stage)) for found in columns.values()]
        lines.append(f"| {stage} | {' | '.join(cells)} |")
    cells = [_cell(found.total()) for found in columns.values()]
    return "\n".join([*lines, f"| all | {' | '.join(cells)} |"])


def _fused(folder: Path, rows: int) -> Stopwatch:
    spec, file = read_spec("fused"), folder / "data.parquet"
    generate(read_recipe("wheel").sized(rows), file)
    watch = Stopwatch("reading the data")
    data = read_dataset(file, spec.features, spec.targets)
    train(spec, data, watch)
    watch("all", 0, 0)
    del watch.seconds["all"]
    return watch


def _any_wheel() -> Stopwatch:
    watch = Stopwatch("reading the data")
    train_any_wheel(read_any_wheel_spec("any_wheel"), watch)
    watch("all", 0, 0)
    del watch.seconds["all"], watch.seconds["reading the data"]
    return watch


def _cell(seconds: tuple[float, float] | None) -> str:
    return "" if seconds is None else f"{seconds[0]:.1f} ({seconds[1]:.1f})"
