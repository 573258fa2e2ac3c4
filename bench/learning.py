"""The regressors: errors against the prior, centres needed, closed-form leave-one-out."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.identification.trained_estimator import for_simulated_case
from soilml.quantities import SHEAR
from training.benchmark.acceptance import goals
from training.benchmark.report import goal_table, tables
from training.benchmark.suite import LIMIT, RECIPE, benchmark
from training.calibration.scores import scored
from training.data.dataset import read_dataset, split
from training.regressors.fixed_size_lssvm import FixedSizeLSSVM
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.lssvm import GAMMAS, LSSVM, Factored
from training.regressors.rbf_kernel import rbf

ROOT = Path(__file__).parents[1]
FEATURES = ("slip", "torque/load", "load")


def comparison() -> str:
    """The released models and the analytic methods on the fixed benchmark, and their goals."""
    case = read_recipe(RECIPE).case
    names = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")
    models = {
        n: for_simulated_case(Estimator.load(ROOT / "exported" / f"{n}.onnx"), case) for n in names
    }
    results = benchmark(models)
    return f"```\n{goal_table(goals(results, LIMIT))}\n\n{tables(results)}\n```"


def sets(folder: Path) -> str:
    """The released files beside the exact posterior of the same sets."""
    from sets import calibration, coverage, densities, errors

    released = ROOT / "exported"
    return "\n\n".join(
        f"### {table.__doc__}\n\n{table(released)}"
        for table in (errors, densities, coverage, calibration)
    )


def flagged() -> str:
    """Foreign readings: what is flagged beside what could be."""
    import flags

    return flags.table()


def rules() -> str:
    """Fusion rules on the same held-out rows, from the released model's own figures."""
    metrics = json.loads(Estimator.load(ROOT / "exported" / "wheel.onnx").metadata["metrics"])
    lines = [
        "| | RMSE / prior c | phi | K | -log p c | phi | K | 90 % holds c | phi | K |",
        "|---|" + "---:|" * 9,
    ]
    for name, m in metrics.items():
        cells = [f"{v:.3f}" for v in (*m["rmse_share_of_prior"], *m["nll"])]
        cells += [f"{v:.1%}" for v in m["cover90"]]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + f"\n\nOn {metrics['estimator']['rows']} rows."


def parity() -> str:
    """Float32 files against their float64 originals; a set posterior has none but its graph."""
    lines = ["| file | kB | largest difference / prior std |", "|---|---:|---:|"]
    for file in sorted((ROOT / "exported").glob("*.onnx")):
        metadata = Estimator.load(file).metadata
        off = metadata.get("parity", "")
        lines.append(f"| {file.name} | {file.stat().st_size / 1e3:.0f} | {off} |")
    return "\n".join(lines)


def centres(folder: Path) -> str:
    """How many centres the inverse problem of one reading needs."""
    generate(read_recipe("wheel"), folder / "data.parquet")
    parts = split(read_dataset(folder / "data.parquet", FEATURES, SHEAR), seed=0)
    train, check = parts.train, parts.calibrate.thinned()
    spread = train.targets.std(axis=0)
    machines = {
        f"fixed-size LS-SVM, {m} centres": (FixedSizeLSSVM(centres=m), len(train))
        for m in (25, 50, 100, 150, 200, 400)
    }
    machines["exact LS-SVM"] = (LSSVM(), 1500)
    machines["MLP, 64 x 64"] = (GaussianMLP(), len(train))
    lines = [
        "| machine | rows | RMSE / prior c | phi | K | -log p, sum | seconds to fit |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for label, (machine, rows) in machines.items():
        started = time.perf_counter()
        machine.fit(train.features[:rows], train.targets[:rows])
        seconds = time.perf_counter() - started
        mean, std = machine.predict(check.features, return_std=True)
        s = scored(check.targets, mean, std, spread)
        errors = " | ".join(f"{v:.4f}" for v in s.relative)
        lines.append(f"| {label} | {rows} | {errors} | {s.nll.sum():.3f} | {seconds:.1f} |")
    return "\n".join(lines) + f"\n\nOn {len(check)} rows not learned from."


def leave_one_out() -> str:
    """The whole grid of gammas from one factorisation against refitting every fold."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    kernel = rbf(x, x, 1.0)
    started = time.perf_counter()
    factored = Factored.of(kernel)
    closed = [np.mean(factored.solved(y, g)[2] ** 2) for g in GAMMAS]
    fast = time.perf_counter() - started
    started = time.perf_counter()
    gamma, errors = GAMMAS[8], []
    for i in range(len(x)):
        rest = np.arange(len(x)) != i
        some = Factored.of(kernel[np.ix_(rest, rest)])
        alpha, bias, _ = some.solved(y[rest], gamma)
        errors.append(y[i] - kernel[i, rest] @ alpha - bias)
    slow = (time.perf_counter() - started) * len(GAMMAS)
    off = abs(np.mean(np.square(errors)) / closed[8] - 1.0)
    return (
        f"300 rows, 3 outputs, {len(GAMMAS)} gammas: closed form {fast * 1e3:.0f} ms, refitting "
        f"every fold {slow:.0f} s (one gamma measured), ratio {slow / fast:,.0f}; the errors agree "
        f"to {off:.0e}."
    )
