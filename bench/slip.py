"""Slip of a wheel-leg from torque and from vibration: fused, and read repeatedly on one soil."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.generate import generate
from datagen.recipe import Block, Recipe, packaged_file, read_recipe
from datagen.simulation import simulate_pieces
from soilml import Estimator
from soilml.onboard.estimate import Estimate
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.quantities import column
from training.dataset import read_dataset
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train

Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
#: Rows of a line, and a seed that no file was trained on and no choice was made on.
ROWS, SEED = 12000, 90125
#: Numbers of repeated readings, and of runs of them.
REPEATS, RUNS = (1, 2, 4, 8, 16), 1000
SENSORS = ("torque", "vibration")
#: Bands of true slip.
BANDS = tuple((0.1 * i, 0.1 * (i + 1)) for i in range(6))
#: Soil -> its recipe, and the end of the names of the released files.
SOILS = {"unknown": ("wheel_leg", ""), "known": ("wheel_leg_known", "_known")}
#: Rules: that of files without the correlation of their errors, eq. 26 of the paper, and ours.
BEFORE, PAPER, OURS = "prior-once", "inverse-variance", "correlated"
#: Worlds that no file was trained on, as lines of the recipe that are changed.
WORLDS: dict[str, dict[str, str]] = {
    "as trained, another seed": {},
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
    columns = {k: np.concatenate([p[k] for p in parts]) for k in ("slip", "load_N", "status")}
    for sensor in SENSORS:
        columns[column(sensor)] = np.concatenate([p[column(sensor)] for p in parts])
    answered = columns.pop("status") == "ok"
    return {k: v[answered] for k, v in columns.items()}


def estimate(file: Estimator, columns: dict[str, Floats]) -> Estimate:
    """Estimates of all rows by a file."""
    return file(**{name: columns[column(name)] for name in file.inputs})


def error_and_cover(found: Estimate, slip: Floats, rows: NDArray[np.bool_]) -> tuple[float, float]:
    """RMSE over the prior's standard deviation, and coverage of the 90 % interval."""
    error = (found.mean[:, 0] - slip)[rows]
    held = ((found.low[:, 0] <= slip) & (slip <= found.high[:, 0]))[rows]
    return float(np.sqrt(np.mean(error**2)) / found.prior.std[0]), float(held.mean())


def cells(pairs: Sequence[tuple[float, float]]) -> str:
    """Cells of a line: error and coverage."""
    return " | ".join(f"{error:.3f}, {100 * held:.1f} %" for error, held in pairs)


def fused_lines(files: Sequence[Estimator], soil: str, worlds: Sequence[str]) -> Iterator[str]:
    """A line for each world: each sensor alone, and both by three rules."""
    for world in worlds:
        columns = simulated(recipe_of(SOILS[soil][0], WORLDS[world], ROWS, Block(1, 1.0)))
        alone = [estimate(file, columns) for file in files]
        by_rule = [fuse_estimates(alone, rule) for rule in (BEFORE, PAPER, OURS)]
        fused = [found.estimate for found in by_rule]
        inside = np.logical_and.reduce([e.in_range for e in alone]) & fused[-1].in_range
        slip = columns["slip"]
        scores = [error_and_cover(e, slip, inside) for e in (*alone, *fused)]
        apart = np.mean(by_rule[-1].disagreement[inside] ** 2)
        share = f"{100 * inside.mean():.1f} %"
        yield f"| {soil} | {world} | {share} | {cells(scores)} | {apart:.1f} |"


def by_slip(files: Sequence[Estimator], soil: str, kind: str) -> str:
    """What the fused 90 % intervals hold in each band of true slip, in the trained world."""
    columns = simulated(recipe_of(SOILS[soil][0], {}, ROWS, Block(1, 1.0)))
    found = fuse_estimates([estimate(file, columns) for file in files]).estimate
    slip, held = columns["slip"], []
    for low, high in BANDS:
        rows = found.in_range & (slip >= low) & (slip < high)
        held.append(f"{100 * error_and_cover(found, slip, rows)[1]:.0f} %")
    return f"| {kind} | {soil} | {' | '.join(held)} |"


def repeated_lines(files: Sequence[Estimator], soil: str, kind: str) -> Iterator[str]:
    """A line for each number of readings of one soil at one slip and load."""
    longest = REPEATS[-1]
    steady = Block(longest, 1.0, ("slip", "load_N"))
    columns = simulated(recipe_of(SOILS[soil][0], {}, longest * RUNS, steady))
    runs = {k: v[: len(v) // longest * longest].reshape(-1, longest) for k, v in columns.items()}
    slip = runs["slip"][:, 0]
    for count in REPEATS:
        each = [
            [estimate(file, {k: v[:, i] for k, v in runs.items()}) for i in range(count)]
            for file in files
        ]
        scores = []
        for readings in (*each, [e for one in each for e in one]):
            for rule in (BEFORE, OURS):
                found = fuse_estimates(readings, rule).estimate
                scores.append(error_and_cover(found, slip, found.in_range))
        yield f"| {kind} | {soil} | {count} | {cells(scores)} |"


def table_head(names: Sequence[str], text: int) -> str:
    """The head of a table whose first columns are text."""
    rule = "|---" * text + "|---:" * (len(names) - text)
    return f"| {' | '.join(names)} |\n{rule}|"


def released(soil: str) -> list[Estimator]:
    """The linear files."""
    folder = ROOT / "exported"
    return [Estimator.load(folder / f"slip_{s}{SOILS[soil][1]}.onnx") for s in SENSORS]


def machines(soil: str, folder: Path) -> list[Estimator]:
    """The LS-SVM variants, which are trained here."""
    data = folder / f"{soil}.parquet"
    generate(read_recipe(SOILS[soil][0]), data)
    files = []
    for sensor in SENSORS:
        spec = read_spec(f"slip_{sensor}_lssvm")
        path = folder / f"{sensor}_{soil}.onnx"
        export_model(train(spec, read_dataset(data, spec.features, spec.targets)), path, data)
        files.append(Estimator.load(path))
    return files


def shares(files: Sequence[Estimator]) -> str:
    """Correlation between the two sensors' errors, and share that each repeats on one soil."""
    from soilml.onboard.joint_errors import joint_errors

    errors = tuple(f.pooling.held_out for f in files if f.pooling.held_out is not None)
    joint = joint_errors(errors)
    common = ", ".join(f"{e.common_share()[0]:.2f}" for e in errors)
    return f"{joint[0].correlation[0, 1]:.2f} | {common}" if joint else " | "


def tables(folder: Path) -> str:
    """All tables as Markdown."""
    measured = {}
    for soil in SOILS:
        measured["linear", soil] = released(soil)
        measured["LS-SVM", soil] = machines(soil, folder)
    names = ("files", "soil", "world", "in range", "torque alone", "vibration alone")
    names += ("both, prior-once (the rule before)", "both, eq. 26", "both, correlated")
    head = table_head((*names, "mean square of the disagreement"), text=3)
    lines = [
        table_head(
            (
                "files",
                "soil",
                "correlation of the errors of torque and vibration",
                "share of its error variance that torque, vibration repeats on one soil",
            ),
            text=2,
        )
    ]
    lines += [f"| {kind} | {soil} | {shares(files)} |" for (kind, soil), files in measured.items()]
    fused = [head]
    for (kind, soil), files in measured.items():
        worlds = list(WORLDS)
        fused += [f"| {kind} {line}" for line in fused_lines(files, soil, worlds)]
    bands = [
        table_head(("files", "soil", *(f"slip {a:.1f} to {b:.1f}" for a, b in BANDS)), text=2),
        *(by_slip(files, soil, kind) for (kind, soil), files in measured.items()),
    ]
    sides = tuple(f"{s}, {r}" for s in (*SENSORS, "both") for r in (BEFORE, OURS))
    repeated = [table_head(("files", "soil", "readings", *sides), text=3)]
    for (kind, soil), files in measured.items():
        repeated += repeated_lines(files, soil, kind)
    return (
        "\n".join(lines)
        + "\n\nOne reading of each sensor:\n\n"
        + "\n".join(fused)
        + "\n\nCoverage of the fused 90 % intervals by true slip, as trained, another seed:\n\n"
        + "\n".join(bands)
        + "\n\nRepeated readings of one soil at one slip and load, of each sensor and of both "
        "(as many of each):\n\n" + "\n".join(repeated)
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        print(tables(Path(temporary)))
