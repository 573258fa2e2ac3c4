"""Accuracy, time and memory of LS-SVMs against the number of rows and prototypes."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from datagen.generate import generate
from datagen.recipe import Block, read_recipe
from soilml.io.atomic_files import atomic_output
from soilml.processes import usable_cores
from training.calibration.recalibration import Metrics, compute_metrics, recalibrate
from training.dataset import Dataset, read_dataset
from training.regressors.gaussian_regressor import FeatureSubset
from training.regressors.lssvm import LSSVM
from training.spec import read_spec

PICTURE = Path(__file__).parents[1] / "docs" / "lssvm.png"
#: Tasks: recipe, the spec whose features and targets are used, and the most rows solved exactly.
TASKS = {
    "soil from one reading of a wheel": ("wheel", "lssvm", 20_000),
    "soil from torque, vibration and sinkage of a wheel-leg": ("wheel_leg", "leg_soil", 5000),
}
EXACT = (500, 2000, 5000, 20_000)
FIXED = (1000, 10_000, 100_000, 1_000_000)
PROTOTYPES = (50, 150, 500)
#: Rows of another seed that hyperparameters are selected on, that are calibrated on, and scored.
VALIDATION, CALIBRATION, SCORED = 4000, 4000, 20_000
ABOUT = (
    "![Error and time against the number of rows](../lssvm.png)\n\n"
    "Rows with a soil of their own each; hyperparameters from "
    f"{VALIDATION} validation rows, intervals recalibrated on {CALIBRATION} others. *Memory*: of "
    "the fit beyond its data, as it is stated before, and the largest resident size measured."
)


@dataclass(frozen=True)
class Fit:
    """A fitted regressor: its size, metrics, seconds, and memory in MB, stated and measured."""

    solution: str
    rows: int
    prototypes: int
    metrics: Metrics
    seconds: float
    stated: float
    peak: float


def tables(folder: Path) -> str:
    """A table for each task, and the picture."""
    found = {name: list(_fits(folder, *task)) for name, task in TASKS.items()}
    draw(found)
    head = (
        "| solution | rows | prototypes | RMSE / prior std | 90 % coverage | negative log density "
        "| seconds | memory stated, MB | measured, MB |\n|---|" + "---:|" * 8
    )
    parts = []
    for name, fits in found.items():
        lines = [f"**{name[0].upper()}{name[1:]}**\n", head]
        for fit in fits:
            m = fit.metrics
            cells = (
                f"{fit.rows:,} | {fit.prototypes:,} | {m.relative.mean():.4f} | "
                f"{m.cover90.mean():.1%} | {m.nll.mean():.3f} | {fit.seconds:.1f} | "
                f"{fit.stated:.0f} | {fit.peak:.0f}"
            )
            lines.append(f"| {fit.solution} | {cells} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + f"\n\nMeans over targets, on {SCORED} rows of another seed."


def _fits(folder: Path, recipe: str, spec: str, most: int) -> Iterator[Fit]:
    data = _rows(folder, recipe, spec, FIXED[-1], 1)
    held_out = _rows(folder, recipe, spec, VALIDATION + CALIBRATION + SCORED, 2)
    cuts = np.split(np.arange(len(held_out)), [VALIDATION, VALIDATION + CALIBRATION])
    others = [held_out.rows(cut) for cut in cuts]
    sizes = [("exact", n, 1) for n in EXACT if n <= most]
    sizes += [("fixed-size", n, m) for m in PROTOTYPES for n in FIXED if n > m]
    for solution, rows, prototypes in sizes:
        print(f"  {solution}, {rows} rows", file=sys.stderr)
        yield _fit(solution, data.rows(np.arange(min(rows, len(data)))), prototypes, others)


def _rows(folder: Path, recipe: str, spec: str, rows: int, seed: int) -> Dataset:
    """Rows with a soil of their own each."""
    wanted, file = read_spec(spec), folder / f"{recipe}_{seed}.parquet"
    alone = replace(read_recipe(recipe), blocks=(Block(1, 1.0, ()),)).sized(rows, seed=seed)
    generate(alone, file)
    return read_dataset(file, wanted.features, wanted.targets)


def _fit(solution: str, data: Dataset, prototypes: int, others: list[Dataset]) -> Fit:
    validation, calibration, scored = others
    model = LSSVM(solution=solution, centres=prototypes)
    regressor = FeatureSubset(solution, model)
    needs = model.requirements(len(data), data.features.shape[1], data.targets.shape[1])
    started = time.perf_counter()
    with peak_memory() as peak:
        regressor.fit(
            (data.features, data.targets),
            (validation.features, validation.targets),
            lambda done, total: None,
        )
    seconds = time.perf_counter() - started
    calibrated = recalibrate(regressor, calibration)
    metrics = compute_metrics(
        scored.targets, *calibrated.predict(scored.features), scored.targets.std(axis=0)
    )
    count = len(model.expansion_.centres)
    return Fit(solution, len(data), count, metrics, seconds, needs.memory / 1e6, peak[0])


@contextmanager
def peak_memory() -> Iterator[list[float]]:
    """Memory in MB that the block took at most beyond what was there; nan where it is not told."""
    peak = [float("nan")]
    try:
        Path("/proc/self/clear_refs").write_text("5")  # forget the peak so far
        before = _status("VmRSS")
    except OSError:
        before = float("nan")
    yield peak
    peak[0] = _status("VmHWM") - before


def _status(name: str) -> float:
    file = Path("/proc/self/status")
    lines = file.read_text().splitlines() if file.exists() else []
    return next((float(x.split()[1]) / 1e3 for x in lines if x.startswith(name)), float("nan"))


def draw(found: dict[str, list[Fit]]) -> None:
    """Error and time against the number of rows."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 3.8), layout="constrained")
    axes = figure.subplots(1, len(found) + 1)
    for axis, (name, fits) in zip(axes, found.items(), strict=False):
        for label, some in _curves(fits):
            errors = [fit.metrics.relative.mean() for fit in some]
            axis.plot([fit.rows for fit in some], errors, "o-", ms=4, label=label)
        axis.set(xscale="log", xlabel="rows learned from", ylabel="RMSE / prior std")
        axis.set_title(name, fontsize=9)
    for label, some in _curves(next(iter(found.values()))):
        times = [fit.seconds for fit in some]
        axes[-1].plot([fit.rows for fit in some], times, "o-", ms=4, label=label)
    axes[-1].set(xscale="log", yscale="log", xlabel="rows learned from", ylabel="seconds")
    axes[-1].set_title(f"time of the fit, {usable_cores()} cores", fontsize=9)
    axes[0].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    with atomic_output(PICTURE) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _curves(fits: list[Fit]) -> Iterator[tuple[str, list[Fit]]]:
    yield "exact", [fit for fit in fits if fit.solution == "exact"]
    for m in PROTOTYPES:
        some = [fit for fit in fits if fit.solution != "exact" and fit.prototypes == m]
        yield f"fixed-size, {m} prototypes", some
