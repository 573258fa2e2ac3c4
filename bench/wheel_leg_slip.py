"""Slip of a wheel-leg from torque and from vibration: fused, and read repeatedly on one soil."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, markdown

from datagen.generate import generate
from datagen.recipe import Block, Recipe, packaged_file, read_recipe
from datagen.simulation import simulate_pieces
from soilml import Estimator
from soilml.onboard.estimate import Estimate
from soilml.onboard.joint_errors import joint_errors
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.quantities import column
from training.dataset import read_dataset
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Rows of a line, and a seed that no file was trained on and no choice was made on.
ROWS, SEED, QUICK_ROWS = 12000, 90125, 600
#: Numbers of repeated readings, and of runs of them.
REPEATS, RUNS, QUICK_RUNS = (1, 2, 4, 8, 16), 1000, 40
SENSORS = ("torque", "vibration")
#: Bands of true slip.
BANDS = tuple((0.1 * i, 0.1 * (i + 1)) for i in range(6))
#: Files: the released linear ones, and LS-SVM variants that are trained here.
FILES = ("linear", "LS-SVM")
#: Soil -> its recipe, and the end of the names of the released files.
SOILS = {"unknown": ("wheel_leg", ""), "known": ("wheel_leg_known", "_known")}
#: Rules: that of files without the correlation of their errors, eq. 26 of the paper, and ours.
BEFORE, PAPER, OURS = "prior-once", "inverse-variance", "correlated"
#: Worlds that no file was trained on, as lines of the recipe that are changed.
TRAINED = "as trained, another seed"
WORLDS: dict[str, dict[str, str]] = {
    TRAINED: {},
    "cohesion 1500 Pa for 500": {"cohesion = 500.0": "cohesion = 1500.0"},
    "bearing exponent 0.8 for 0.7": {"n = 0.7": "n = 0.8"},
    "noise twice as large": {'"3 %"\nd': '"6 %"\nd', "s2 = 0.2": "s2 = 0.4"},
    "leg softer by 15 %": {
        "[3500.0, 4500.0]": "[2975.0, 3825.0]", "[3950.0, 4050.0]": "[3357.5, 3442.5]",
    },
    "friction drops by 0.30 to 0.35": {
        "[0.2, 0.3]": "[0.3, 0.35]", "[0.245, 0.255]": "[0.3, 0.35]",
    },
}  # fmt: skip
ABOUT = (
    "Slip from torque and from vibration (Comin and Saaj 2017, eqs. 18 and 24). The released "
    "linear files, and LS-SVM variants trained on the same data, are tested on strides that no "
    "file was trained on. Each cell: RMSE over the standard deviation of the prior, coverage of "
    "the 90 % interval. The rules prior-once and eq. 26 take errors for independent. *World*: what "
    "differs from the recipe of the files. *Disagreement*: difference between the two files in "
    "standard deviations of that difference, 1 where both are right."
)


def cases(sample: Sample) -> list[Row]:
    """Each kind of file on each soil, in worlds and on repeated readings."""
    rows, runs = (QUICK_ROWS, QUICK_RUNS) if sample.quick else (ROWS, RUNS)
    files = FILES[:1] if sample.quick else FILES
    own = [{"files": kind, "soil": soil} for kind in files for soil in SOILS]
    found = [one | {"world": w, "rows": rows} for one in own for w in WORLDS]
    return found + [one | {"repeats": REPEATS, "rows": REPEATS[-1] * runs} for one in own]


@cache
def files_of(kind: str, soil: str) -> list[Estimator]:
    """The linear files, or the LS-SVM variants, which are trained here."""
    recipe, end = SOILS[soil]
    if kind == "linear":
        return [Estimator.load(ROOT / "exported" / f"slip_{s}{end}.onnx") for s in SENSORS]
    files = []
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.parquet"
        generate(read_recipe(recipe), data)
        for sensor in SENSORS:
            spec, path = read_spec(f"slip_{sensor}_lssvm"), Path(folder) / f"{sensor}.onnx"
            export_model(train(spec, read_dataset(data, spec.features, spec.targets)), path, data)
            files.append(Estimator.load(path))
    return files


def recipe_of(name: str, changes: dict[str, str], rows: int, *blocks: Block) -> Recipe:
    """A packaged recipe with some of its text changed, of another seed."""
    text = packaged_file(name, "datagen", "recipes").read_text()
    for old, new in changes.items():
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.toml"
        path.write_text(text)
        return replace(read_recipe(path), blocks=blocks).sized(rows, SEED)


def simulated(recipe: Recipe) -> dict[str, Floats]:
    """Columns of the rows that have an answer."""
    parts = list(simulate_pieces(recipe))
    names = ("slip", "load_N", "status", *(column(sensor) for sensor in SENSORS))
    columns = {k: np.concatenate([p[k] for p in parts]) for k in names}
    answered = columns.pop("status") == "ok"
    return {k: v[answered] for k, v in columns.items()}


def estimate(file: Estimator, columns: dict[str, Floats]) -> Estimate:
    """Estimates of all rows by a file."""
    return file(**{name: columns[column(name)] for name in file.inputs})


def scores(found: Estimate, slip: Floats, rows: Any) -> str:
    """RMSE over the prior's standard deviation, and coverage of the 90 % interval."""
    error = np.sqrt(np.mean((found.mean[:, 0] - slip)[rows] ** 2)) / found.prior.std[0]
    held = ((found.low[:, 0] <= slip) & (slip <= found.high[:, 0]))[rows].mean()
    return f"{error:.3f}, {100 * held:.1f} %"


def measured(case: Row) -> Row | list[Row]:
    """Cells of a line: each sensor alone, and both by three rules; or of repeated readings."""
    files, (recipe, _) = files_of(case["files"], case["soil"]), SOILS[case["soil"]]
    if "repeats" in case:
        return repeated(files, recipe, case["rows"])
    columns = simulated(recipe_of(recipe, WORLDS[case["world"]], case["rows"], Block(1, 1.0)))
    alone, slip = [estimate(file, columns) for file in files], columns["slip"]
    by_rule = [fuse_estimates(alone, rule) for rule in (BEFORE, PAPER, OURS)]
    fused = [found.estimate for found in by_rule]
    inside = np.logical_and.reduce([e.in_range for e in alone]) & fused[-1].in_range
    found: Row = {
        "in_range": f"{100 * inside.mean():.1f} %",
        "scores": [scores(e, slip, inside) for e in (*alone, *fused)],
        "apart": f"{np.mean(by_rule[-1].disagreement[inside] ** 2):.1f}",
    }
    if case["world"] == TRAINED:
        own, held = fused[-1], []
        for low, high in BANDS:
            rows = own.in_range & (slip >= low) & (slip < high)
            inside = (own.low[:, 0] <= slip) & (slip <= own.high[:, 0])
            held.append(f"{100 * inside[rows].mean():.0f} %")
        found |= {"bands": held, "shares": shares(files)}
    return found


def shares(files: Sequence[Estimator]) -> list[str]:
    """Correlation between the two sensors' errors, and share that each repeats on one soil."""
    errors = tuple(f.errors for f in files if f.errors is not None)
    joint = joint_errors(errors)
    common = ", ".join(f"{e.common_share()[0]:.2f}" for e in errors)
    return [f"{joint[0].correlation[0, 1]:.2f}", common] if joint else ["", ""]


def repeated(files: Sequence[Estimator], recipe: str, rows: int) -> list[Row]:
    """Cells for each number of readings of one soil at one slip and load."""
    longest = REPEATS[-1]
    steady = Block(longest, 1.0, ("slip", "load_N"))
    columns = simulated(recipe_of(recipe, {}, rows, steady))
    runs = {k: v[: len(v) // longest * longest].reshape(-1, longest) for k, v in columns.items()}
    slip, lines = runs["slip"][:, 0], []
    for count in REPEATS:
        each = [
            [estimate(file, {k: v[:, i] for k, v in runs.items()}) for i in range(count)]
            for file in files
        ]
        told = []
        for readings in (*each, [e for one in each for e in one]):
            for rule in (BEFORE, OURS):
                found = fuse_estimates(readings, rule).estimate
                told.append(scores(found, slip, found.in_range))
        lines.append({"readings": count, "scores": told})
    return lines


def tables(rows: list[Row]) -> str:
    """Correlations, worlds, bands of slip, repeated readings."""

    def named(own: list[Row], *members: str, lists: str = "") -> list[tuple[Any, ...]]:
        keys = ("files", "soil", *members)
        return [(*(r[k] for k in keys), *r.get(lists, ())) for r in own]

    worlds = [r for r in rows if "world" in r]
    trained, again = [r for r in worlds if "bands" in r], [r for r in rows if "readings" in r]
    head = ("files", "soil")
    correlation = (
        "correlation of the errors of torque and vibration",
        "share of its error variance that torque, vibration repeats on one soil",
    )
    fused = ("both, prior-once (the rule before)", "both, eq. 26", "both, correlated")
    fused = ("world", "in range", "torque alone", "vibration alone", *fused)
    lines = [
        (*line, r["apart"])
        for line, r in zip(named(worlds, "world", "in_range", lists="scores"), worlds, strict=True)
    ]
    bands = tuple(f"slip {a:.1f} to {b:.1f}" for a, b in BANDS)
    sides = tuple(f"{s}, {rule}" for s in (*SENSORS, "both") for rule in (BEFORE, OURS))
    parts = [
        markdown((*head, *correlation), named(trained, lists="shares"), 2),
        "One reading of each sensor:",
        markdown((*head, *fused, "mean square of the disagreement"), lines, 3),
        "Coverage of the fused 90 % intervals by true slip, as trained, another seed:",
        markdown((*head, *bands), named(trained, lists="bands"), 2),
        "Repeated readings of one soil at one slip and load, of each sensor and of both (as many "
        "of each):",
        markdown((*head, "readings", *sides), named(again, "readings", lists="scores"), 3),
    ]
    return "\n\n".join(parts)


SLIP = Bench("slip", "Slip of a wheel-leg", ABOUT, cases, measured, tables)
