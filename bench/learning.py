"""Learned estimators: benchmark, calibration, fusion rules, leave-one-out."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.identification.trained_estimator import for_simulated_case
from training.benchmark.acceptance import goals
from training.benchmark.report import LEGEND, format_goals, format_tables
from training.benchmark.suite import RECIPE, benchmark
from training.regressors.exact_solution import GAMMAS, KernelEigensystem
from training.regressors.rbf_expansion import rbf

ROOT = Path(__file__).parents[1]


def comparison() -> str:
    """Released models and analytic methods on the fixed benchmark, with acceptance goals."""
    case = read_recipe(RECIPE).case
    names = ("wheel", "wheel_lssvm", "wheel_mlp", "wheel_linear", "any_wheel")
    models = {
        n: for_simulated_case(Estimator.load(ROOT / "exported" / f"{n}.onnx"), case) for n in names
    }
    results = benchmark(models)
    text = f"{format_goals(goals(results))}\n\n{format_tables(results)}"
    legend = " ".join(f"`{term}`: {meaning}" for term, meaning in LEGEND)
    return f"{legend}\n\n```\n{text}\n```"


def sets(folder: Path) -> str:
    """The released files against the exact posterior of the same sets."""
    from sets import all_tables

    return all_tables(ROOT / "exported")


def flagged() -> str:
    """Detection of faults by the released files, and by statistical tests."""
    import flags

    return flags.tables()


def rules() -> str:
    """Fusion rules on the same held-out rows, from the metadata of the released model."""
    metrics = json.loads(Estimator.load(ROOT / "exported" / "wheel.onnx").metadata["metrics"])
    lines = [
        "| | RMSE / prior std, c | phi | K | negative log density, c | phi | K "
        "| 90 % coverage, c | phi | K |",
        "|---|" + "---:|" * 9,
    ]
    for name, m in metrics.items():
        cells = [f"{v:.3f}" for v in (*m["rmse_share_of_prior"], *m["nll"])]
        cells += [f"{v:.1%}" for v in m["cover90"]]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + f"\n\nOn {metrics['estimator']['rows']} held-out rows."


def parity() -> str:
    """Float32 files against their float64 originals; a set posterior exists as a graph only."""
    lines = ["| file | kB | largest difference / prior std |", "|---|---:|---:|"]
    for file in sorted((ROOT / "exported").glob("*.onnx")):
        metadata = Estimator.load(file).metadata
        off = metadata.get("parity", "")
        lines.append(f"| {file.name} | {file.stat().st_size / 1e3:.0f} | {off} |")
    return "\n".join(lines)


def leave_one_out() -> str:
    """Leave-one-out errors for a grid of gammas: one factorisation against refitting all folds."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    kernel = rbf(x, x, 1.0)
    started = time.perf_counter()
    eigensystem = KernelEigensystem.of(kernel)
    closed = [np.mean(eigensystem.solve(y, g)[2] ** 2) for g in GAMMAS]
    fast = time.perf_counter() - started
    started = time.perf_counter()
    gamma, errors = GAMMAS[8], []
    for i in range(len(x)):
        rest = np.arange(len(x)) != i
        some = KernelEigensystem.of(kernel[np.ix_(rest, rest)])
        alpha, bias, _ = some.solve(y[rest], gamma)
        errors.append(y[i] - kernel[i, rest] @ alpha - bias)
    slow = (time.perf_counter() - started) * len(GAMMAS)
    off = abs(np.mean(np.square(errors)) / closed[8] - 1.0)
    return (
        f"300 rows, 3 outputs, {len(GAMMAS)} gammas: closed form {fast * 1e3:.0f} ms, refitting "
        f"every fold {slow:.0f} s (extrapolated from one gamma), ratio {slow / fast:,.0f}; "
        f"relative difference of the mean squared errors: {off:.0e}."
    )
