"""Table, figure and page of a comparison on the user's test data."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from soilml.io.atomic_files import atomic_output
from soilml.io.text_tables import format_table
from soilml.quantities import QUANTITIES
from training.benchmark.acceptance import COVERAGE_RANGE
from training.benchmark.methods import MethodKind
from training.benchmark.table_format import columns_of_rows, display_unit, format_number
from training.benchmark.user_comparison import MethodScore


def csv_columns(scores: Sequence[MethodScore], names: Sequence[str]) -> dict[str, list[Any]]:
    """The CSV table, in SI units: one row per size of set, method and parameter."""
    return columns_of_rows(
        {
            "rows_in_set": score.rows,
            "method": score.method,
            "inputs": score.inputs,
            "parameter": QUANTITIES[name].column,
            "sets": score.sets,
            "failed": score.failed,
            "rmse": float(score.rmse[k]),
            "rmse_share_of_prior": float(score.rmse_over_prior[k]),
            "cover50": float(score.coverage50[k]),
            "cover90": float(score.coverage90[k]),
            "seconds_per_estimate": score.seconds,
        }
        for score in scores
        for k, name in enumerate(names)
    )


def format_tables(scores: Sequence[MethodScore], names: Sequence[str]) -> str:
    """A text table for each size of set."""
    header = ["method", "inputs"]
    for name in names:
        unit, symbol = display_unit(name)[1], QUANTITIES[name].symbol
        header += [f"{symbol} RMSE {unit}", "/prior", "90 %"]
    header += ["failed", "ms"]
    blocks = []
    for size in sorted({score.rows for score in scores}):
        rows = [_cells(score, names) for score in scores if score.rows == size]
        title = "single readings" if size == 1 else f"{size} readings of one soil"
        blocks.append(f"{title}\n\n{format_table(header, rows, text_columns=2)}")
    return "\n\n".join(blocks)


def _cells(score: MethodScore, names: Sequence[str]) -> list[str]:
    cells = [score.method, score.inputs]
    for k, name in enumerate(names):
        cells += [
            format_number(score.rmse[k] * display_unit(name)[0], ".3g"),
            format_number(score.rmse_over_prior[k], ".3f"),
            "" if np.isnan(score.rmse[k]) else f"{score.coverage90[k]:.0%}",
        ]
    milliseconds = f"{1e3 * score.seconds:.2g}" if score.seconds else ""
    return [*cells, f"{score.failed}/{score.sets}", milliseconds]


def plot_comparison(
    scores: Sequence[MethodScore], names: Sequence[str], path: str | os.PathLike[str]
) -> None:
    """RMSE over the prior's standard deviation, and coverage of 90 % intervals, as PNG."""
    from matplotlib.figure import Figure

    sizes = sorted({score.rows for score in scores})
    kinds = {score.method: score.kind for score in scores}
    methods = [m for m, kind in kinds.items() if kind is not MethodKind.PRIOR]
    figure = Figure(figsize=(3.9 * len(names), 6.4), layout="constrained")
    axes = figure.subplots(2, len(names), squeeze=False, sharex=True)
    for k, name in enumerate(names):
        error, coverage = axes[0][k], axes[1][k]
        error.axhline(1.0, color="0.4", lw=1, ls="--", label="prior")
        for i, method in enumerate(methods):
            own = [score for score in scores if score.method == method]
            # methods side by side around the tick of their set size
            x = np.asarray([sizes.index(s.rows) for s in own]) + 0.09 * (i - len(methods) / 2)
            marker = "s" if kinds[method] is MethodKind.ANALYTIC else "o"
            style: dict[str, Any] = {"color": f"C{i}", "ms": 5}
            error.plot(x, [s.rmse_over_prior[k] for s in own], marker, label=method, **style)
            coverage.plot(x, [s.coverage90[k] for s in own], marker, label=method, **style)
        error.set_title(name.replace("_", " "))
        error.set_ylim(bottom=0)
        coverage.axhspan(*COVERAGE_RANGE, color="C2", alpha=0.2, lw=0)
        lowest = [s.coverage90[k] for s in scores if np.isfinite(s.coverage90[k])]
        coverage.set_ylim(min([0.5, *lowest]) - 0.02, 1.02)
        coverage.set_xticks(range(len(sizes)), [str(size) for size in sizes])
        coverage.set_xlabel("readings per set")
        for panel in (error, coverage):
            panel.grid(alpha=0.3)
    axes[0][0].set_ylabel("RMSE / prior standard deviation")
    axes[1][0].set_ylabel("coverage of 90 % interval")
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    with atomic_output(path) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def comparison_page(scores: Sequence[MethodScore], names: Sequence[str], test: str) -> str:
    """The Markdown page that accompanies table and figure."""
    single = [
        score
        for score in scores
        if score.rows == 1
        and score.kind is not MethodKind.PRIOR
        and np.isfinite(score.rmse_over_prior).all()
    ]
    best = min(single, key=lambda score: float(score.rmse_over_prior.mean()))
    ratios = zip(names, best.rmse_over_prior, strict=True)
    shares = ", ".join(f"{name.replace('_', ' ')} {ratio:.0%}" for name, ratio in ratios)
    return (
        f"# Comparison on {test}\n\n"
        f"From a single reading, the best method ({best.method}) has an RMSE, relative to the "
        f"prior's standard deviation, of: {shares}. One equation does not determine three "
        "unknowns: the prior supplies the missing information, and intervals must be "
        "correspondingly wide.\n\n"
        "`RMSE` is over all sets; a failed fit counts as the prior's median, and estimates outside "
        "the prior are clipped to it. `/prior`: RMSE over the prior's standard deviation. `90 %`: "
        "coverage of the 90 % interval, of the sets answered. `failed`: sets without an estimate, "
        "of all. `ms`: wall time of one estimate. Methods marked `K fixed` or `c fixed` take that "
        "parameter from the model file.\n\n"
        "![comparison](compare.png)\n\nFigure: RMSE over the prior's standard deviation (top; "
        "dashed: the prior) and coverage of 90 % intervals (bottom; green: 88 to 92 %) against the "
        "number of readings per set. Squares: analytic methods.\n\n"
        f"```\n{format_tables(scores, names)}\n```\n"
    )
