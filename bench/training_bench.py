"""How long training takes."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from runner import Bench, Row, Sample, each, table

from datagen.generate import generate
from datagen.recipe import read_recipe
from training.dataset import read_dataset
from training.spec import read_any_wheel_spec, read_spec
from training.train import train, train_any_wheel

#: Rows of the data of the recipe `wheel`, whose own number is the first; rows of a quick look.
ROWS, QUICK_ROWS = (96_000, 192_000, 400_000), 4_000
ABOUT_TIME = (
    "`soilml train fused` on rows of the recipe `wheel`, and `soilml train any_wheel`. Goals: 30 s "
    "for the 96 000 rows of the demonstration, 120 s for `any_wheel`, and cost that grows linearly "
    "with the number of rows. *Processor time* is that of all processes; where other programs "
    "run, wall time is longer."
)


def time_cases(sample: Sample) -> list[Row]:
    """`fused` for each number of rows, and `any_wheel`."""
    rows = (QUICK_ROWS,) if sample.quick else ROWS
    return [{"rows": n} for n in rows] + ([] if sample.quick else [{"rows": 0}])


def training_time(case: Row) -> Row:
    """Wall and processor time of a training, those of worker processes included."""
    name = f"fused, {case['rows']:,} rows" if case["rows"] else "any_wheel"
    with tempfile.TemporaryDirectory() as folder:
        if case["rows"]:
            spec, file = read_spec("fused"), Path(folder) / "data.parquet"
            generate(read_recipe("wheel").sized(case["rows"]), file)
        begun, began = time.perf_counter(), os.times()
        if case["rows"]:
            train(spec, read_dataset(file, spec.features, spec.targets))
        else:
            train_any_wheel(read_any_wheel_spec("any_wheel"))
        spent, ended = time.perf_counter() - begun, os.times()
    return {"name": name, "wall": spent, "processor": sum(ended[:4]) - sum(began[:4])}


def time_table(rows: list[Row]) -> str:
    """A line for each training."""
    columns = {"wall time, s": each("wall", ".1f"), "processor time, s": each("processor", ".1f")}
    return table(rows, {"training": "name"}, columns)


TRAINING = Bench(
    "training", "Time of training", ABOUT_TIME, time_cases, training_time, time_table, timed=True
)
