"""Table, figure and page of a comparison on the user's test data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import QUANTITIES
from soilml.remarks import Remark
from soilml.report.figure_style import UNCHANGED, short_label, take_axes
from soilml.report.numbers import format_quantity
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from training.benchmark.acceptance import COVERAGE_RANGE
from training.benchmark.methods import MethodKind
from training.benchmark.paired_results import MethodResult
from training.benchmark.report import columns_of_rows


def csv_columns(scores: Sequence[MethodResult], names: Sequence[str]) -> dict[str, list[Any]]:
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
            "seconds_per_estimate": score.estimates.seconds,
        }
        for score in scores
        for k, name in enumerate(names)
    )


def _table(scores: Sequence[MethodResult], names: Sequence[str], size: int) -> ReportTable:
    """A row for each method, from sets of this size."""
    own = [score for score in scores if score.rows == size]
    columns = [Column("method", [s.method for s in own]), Column("inputs", [s.inputs for s in own])]
    for k, name in enumerate(names):
        quantity = QUANTITIES[name]
        columns += [
            Column(quantity.symbol, [s.rmse[k] for s in own], quantity.unit, digits=3),
            Column("/prior", [s.rmse_over_prior[k] for s in own], digits=3),
            Column("in 90 %", [s.coverage90[k] for s in own], "share", digits=2),
        ]
    columns.append(Column("failed", [f"{s.failed}/{s.sets}" for s in own]))
    columns.append(Column("ms", [1e3 * s.estimates.seconds for s in own], digits=2))
    return ReportTable("single readings" if size == 1 else f"{size} readings of one soil", columns)


def plot_comparison(
    scores: Sequence[MethodResult], names: Sequence[str], ax: Any = None
) -> NDArray[Any]:
    """Draw the RMSE over the prior's standard deviation, and the coverage of 90 % intervals.

    `ax` takes two axes for each of q parameters; a new figure where None. Returns them, (2, q).
    """
    sizes = sorted({score.rows for score in scores})
    kinds = {score.method: score.kind for score in scores}
    methods = [m for m, kind in kinds.items() if kind is not MethodKind.PRIOR]
    axes = take_axes(ax, 2, len(names), figure_size(names))
    for k, name in enumerate(names):
        error, coverage = axes[0][k], axes[1][k]
        error.axhline(1.0, color=UNCHANGED, lw=1, ls="--", label="prior")
        for i, method in enumerate(methods):
            own = [score for score in scores if score.method == method]
            # methods side by side around the tick of their set size
            x = np.asarray([sizes.index(s.rows) for s in own]) + 0.09 * (i - len(methods) / 2)
            marker = "s" if kinds[method] is MethodKind.ANALYTIC else "o"
            style: dict[str, Any] = {"color": f"C{i}", "ms": 5}
            error.plot(
                x, [s.rmse_over_prior[k] for s in own], marker, label=short_label(method), **style
            )
            coverage.plot(
                x, [s.coverage90[k] for s in own], marker, label=short_label(method), **style
            )
        error.set_title(name.replace("_", " "))
        error.set_ylim(bottom=0)
        coverage.axhspan(*COVERAGE_RANGE, color="C2", alpha=0.2, lw=0)
        lowest = [s.coverage90[k] for s in scores if np.isfinite(s.coverage90[k])]
        coverage.set_ylim(min([0.5, *lowest]) - 0.02, 1.02)
        for panel in (error, coverage):
            panel.set_xticks(range(len(sizes)), [str(size) for size in sizes])
        coverage.set_xlabel("readings per set")
        error.set_ylabel("RMSE / prior standard deviation")
        coverage.set_ylabel("coverage of 90 % interval")
    axes[0][0].legend()
    return axes


def figure_size(names: Sequence[str]) -> tuple[float, float]:
    """Width and height of the figure, inches."""
    return 3.9 * len(names), 6.4


def comparison_report(scores: Sequence[MethodResult], names: Sequence[str], test: str) -> Report:
    """The report of a comparison on test data of this name."""
    sizes = sorted({score.rows for score in scores})
    verdict, *lines = [
        said for size in dict.fromkeys((sizes[0], sizes[-1])) for said in _best(scores, names, size)
    ] or ["No method has an estimate of every set."]
    return Report(
        kind="compare",
        verdict=verdict,
        lines=lines,
        tables=[_table(scores, names, size) for size in sizes],
        pictures=[
            Picture(
                "Errors and coverage", partial(plot_comparison, scores, names), 2, len(names),
                figure_size(names), verdict,
                "RMSE over the prior's standard deviation (top; dashed: the prior) and coverage of "
                "90 % intervals (bottom; green: 88 to 92 %) against the number of readings per "
                "set. Squares: analytic methods.",
            )
        ],
        remarks=[
            Remark(
                "prior-supplies-information",
                "one equation does not determine three unknowns: for single readings the prior "
                "supplies the missing information, and intervals must be correspondingly wide",
                severity="note",
            )
        ],
        next_steps=["soilml estimate MODEL.onnx RUNS.csv with the method that suits your rows"],
        status=f"{len({s.method for s in scores})} methods",
        title=f"Comparison of methods on {test}",
        basis=f"sets of {', '.join(map(str, sizes))} readings whose soil is known",
        notation=[
            (
                "c, phi, K",
                "RMSE over all sets; a failed fit counts as the prior's median, and estimates "
                "outside the prior are clipped to it.",
            ),
            ("/prior", "RMSE over the prior's standard deviation."),
            ("in 90 %", "coverage of the 90 % interval, of the sets answered."),
            ("failed", "sets without an estimate, of all."),
            ("ms", "wall time of one estimate."),
            ("fixed", "a parameter that a method takes from the model file."),
        ],
    )  # fmt: skip


def _best(scores: Sequence[MethodResult], names: Sequence[str], size: int) -> Iterator[str]:
    """The method with the least errors from sets of this size, and its errors."""
    own = [
        score
        for score in scores
        if score.rows == size
        and score.kind is not MethodKind.PRIOR
        and np.isfinite(score.rmse_over_prior).all()
    ]
    if not own:
        return
    best = min(own, key=lambda score: float(score.rmse_over_prior.mean()))
    errors = ", ".join(
        f"{format_quantity(ratio, 'share', digits=2)} ({name.replace('_', ' ')})"
        for name, ratio in zip(names, best.rmse_over_prior, strict=True)
    )
    readings = "1 reading" if size == 1 else f"{size} readings"
    yield f"From {readings}, {best.method} is best: RMSE {errors} of the prior's deviation."
