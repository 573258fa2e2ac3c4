"""Slip files trained on campaigns of few rows: `python bench/few_rows.py [CAMPAIGNS]`.

Each line is the mean over campaigns that are drawn from simulated strides. Coverage and error are
those of readings of other soils, of another seed.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from slip import SENSORS, SOILS, error_and_cover, estimate, recipe_of, simulated

from datagen.generate import generate
from datagen.recipe import Block, read_recipe
from soilml import Estimator
from soilml.io.text_tables import format_table
from soilml.onboard.multi_sensor import fuse_estimates
from training.dataset import Dataset, read_dataset
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train

CAMPAIGNS, SEED = 10, 3
#: Soils of a campaign, and rows on each.
SIZES = ((20, 1), (60, 1), (240, 1), (4, 15))
KINDS = {"linear": "", "LS-SVM": "_lssvm"}
ROWS_OF_THE_TEST = 2000


def draw(data: Dataset, soils: int, rows: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Rows of a campaign: so many soils, with so many rows of each."""
    runs = [run for run in data.runs() if len(run) >= rows and (len(run) == 1) == (rows == 1)]
    chosen = rng.choice(len(runs), soils, replace=False)
    return np.sort(np.concatenate([runs[k][:rows] for k in chosen]))


def lines(soil: str, kind: str, campaigns: int, folder: Path) -> Iterator[tuple[str, ...]]:
    """A line for each size of campaign: each sensor alone, and both."""
    data_path = folder / f"{soil}.parquet"
    if not data_path.exists():
        generate(read_recipe(SOILS[soil][0]), data_path)
    specs = [f"slip_{sensor}{KINDS[kind]}" for sensor in SENSORS]
    whole = []
    for name in specs:
        spec = read_spec(name)
        whole.append(read_dataset(data_path, spec.features, spec.targets))
    common = np.intersect1d(whole[0].row, whole[1].row)
    whole = [data.rows(np.isin(data.row, common)) for data in whole]
    test = simulated(recipe_of(SOILS[soil][0], {}, ROWS_OF_THE_TEST, Block(1, 1.0)))
    for soils, rows in SIZES:
        rng, scores = np.random.default_rng(SEED), []
        for _ in range(campaigns):
            index = draw(whole[0], soils, rows, rng)
            answers = []
            for name, data in zip(specs, whole, strict=True):
                file = folder / f"{name}.onnx"
                export_model(train(read_spec(name), data.rows(index)), file, data_path)
                answers.append(estimate(Estimator.load(file), test))
            answers.append(fuse_estimates(answers).estimate)
            inside = np.logical_and.reduce([e.in_range for e in answers])
            scores.append([error_and_cover(e, test["slip"], inside) for e in answers])
        mean = np.mean(scores, axis=0)
        found = (f"{error:.3f}, {100 * held:.1f} %" for error, held in mean)
        yield kind, soil, f"{soils} x {rows}", *found


def run(campaigns: int) -> None:
    """Print the table."""
    found = []
    with tempfile.TemporaryDirectory() as temporary:
        for soil in SOILS:
            for kind in KINDS:
                for line in lines(soil, kind, campaigns, Path(temporary)):
                    print(*line, file=sys.stderr, flush=True)
                    found.append(line)
    print(f"Campaigns of few rows, means of {campaigns}: RMSE of slip over the standard deviation")
    print("of the prior, and coverage of the 90 % intervals, on readings of other soils\n")
    print(format_table(("files", "soil", "soils x rows", *SENSORS, "fused"), found, 3))


if __name__ == "__main__":
    run(int(sys.argv[1]) if len(sys.argv) > 1 else CAMPAIGNS)
