"""Table, figure and page of a comparison of methods."""

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
from training.benchmark.comparison import MethodResult

PANEL = (3.9, 3.2)  # Width and height of a panel of the figure, inches
NOMINAL = (0.88, 0.92)  # Coverage of 90 % intervals that is marked as good
NOTATION = (
    (
        "c, phi, K",
        "RMSE over all sets; a failed fit counts as the prior's median, and estimates outside the "
        "prior are clipped to it.",
    ),
    ("/prior", "RMSE over the prior's standard deviation."),
    (
        "/limit",
        "RMSE over that of the exact posterior's mean on the same sets, which no estimator beats "
        "on average, and its standard error (jackknife over sets).",
    ),
    ("in 90 %", "coverage of the 90 % interval, of the sets answered."),
    ("failed", "sets without an estimate, of all."),
    ("ms", "wall time of one estimate."),
    ("fixed", "a parameter that a method takes from the model file, not from the truth."),
)


def csv_columns(results: Sequence[MethodResult], names: Sequence[str]) -> dict[str, list[Any]]:
    """The CSV table, in SI units: one row per design, method and parameter."""
    rows = [
        {
            "rows_in_set": r.rows,
            "one_load": r.one_load,
            "method": r.method.label,
            "inputs": r.method.inputs,
            "parameter": QUANTITIES[name].column,
            "sets": len(r.truth),
            "failed": r.failed,
            "rmse": float(r.rmse[k]),
            "rmse_share_of_prior": float(r.rmse_over_prior[k]),
            "rmse_over_limit": float(r.over_limit[0][k]),
            "rmse_over_limit_std": float(r.over_limit[1][k]),
            "cover90": float(r.coverage[k]),
            "seconds_per_estimate": r.seconds,
        }
        for r in results
        for k, name in enumerate(names)
    ]
    return {key: [row[key] for row in rows] for key in rows[0]}


def _table(own: Sequence[MethodResult], names: Sequence[str]) -> ReportTable:
    """A row for each method, from sets of one design."""
    columns = [Column("method", [r.method.label for r in own])]
    for k, name in enumerate(names):
        quantity = QUANTITIES[name]
        ratio, error = ([r.over_limit[i][k] for r in own] for i in (0, 1))
        columns += [
            Column(quantity.symbol, [r.rmse[k] for r in own], quantity.unit, digits=3),
            Column("/prior", [r.rmse_over_prior[k] for r in own], digits=3),
            Column("/limit", ratio, std=np.nan_to_num(error).tolist(), digits=4),
            Column("in 90 %", [r.coverage[k] for r in own], "share", digits=2),
        ]
    columns.append(Column("failed", [f"{r.failed}/{len(r.truth)}" for r in own]))
    columns.append(Column("ms", [1e3 * r.seconds for r in own], digits=2))
    columns.append(Column("inputs", [r.method.inputs for r in own]))
    return ReportTable(own[0].design, columns)


def plot_comparison(results: Sequence[MethodResult], names: Sequence[str], ax: Any = None) -> Any:
    """Draw the RMSE over the prior's standard deviation, and the coverage of 90 % intervals.

    `ax` takes two axes for each of q parameters; a new figure where None. Returns them, (2, q).
    """
    designs = list(dict.fromkeys(r.design for r in results))
    methods = [m for m in dict.fromkeys(r.method.label for r in results) if m != "prior"]
    axes: NDArray[Any] = take_axes(ax, 2, len(names), _size(names))
    for k, name in enumerate(names):
        error, coverage = axes[0][k], axes[1][k]
        error.axhline(1.0, color=UNCHANGED, lw=1, ls="--", label="prior")
        for i, method in enumerate(methods):
            own = [r for r in results if r.method.label == method]
            # methods side by side around the tick of their design
            x = np.asarray([designs.index(r.design) for r in own]) + 0.09 * (i - len(methods) / 2)
            style: dict[str, Any] = {"color": f"C{i}", "ms": 5, "label": short_label(method)}
            marker = "s" if own[0].method.analytic else "o"
            error.plot(x, [r.rmse_over_prior[k] for r in own], marker, **style)
            coverage.plot(x, [r.coverage[k] for r in own], marker, **style)
        error.set_title(name.replace("_", " "))
        error.set_ylim(bottom=0)
        coverage.axhspan(*NOMINAL, color="C2", alpha=0.2, lw=0)
        lowest = [c for r in results if np.isfinite(c := r.coverage[k])]
        coverage.set_ylim(min([0.5, *lowest]) - 0.02, 1.02)
        ticks = [f"{r.rows}{'' if r.one_load else '*'}" for r in _first_of_each(results)]
        for panel in (error, coverage):
            panel.set_xticks(range(len(designs)), ticks)
        coverage.set_xlabel("readings per set (*: several loads)")
        error.set_ylabel("RMSE / prior standard deviation")
        coverage.set_ylabel("coverage of 90 % interval")
    axes[0][0].legend(fontsize=7)
    return axes


def _size(names: Sequence[str]) -> tuple[float, float]:
    return PANEL[0] * len(names), 2 * PANEL[1]


def _first_of_each(results: Sequence[MethodResult]) -> list[MethodResult]:
    """The first result of each design."""
    return list({r.design: r for r in reversed(results)}.values())[::-1]


def comparison_report(results: Sequence[MethodResult], names: Sequence[str], test: str) -> Report:
    """The report of a comparison on test data of this name."""
    designs = [
        [r for r in results if r.design == first.design] for first in _first_of_each(results)
    ]
    ends = designs[:1] + designs[1:][-1:]
    verdict, *lines = [said for own in ends for said in _best(own, names)] or [
        "No method has an estimate of every set."
    ]
    return Report(
        kind="compare",
        verdict=verdict,
        lines=lines,
        tables=[_table(own, names) for own in designs],
        pictures=[
            Picture(
                "Errors and coverage", partial(plot_comparison, results, names), 2, len(names),
                _size(names), verdict,
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
        status=f"{len({r.method.label for r in results})} methods",
        title=f"Comparison of methods on {test}",
        basis=f"sets of {', '.join(str(own[0].rows) for own in designs)} readings, soil known",
        notation=NOTATION,
    )  # fmt: skip


def _best(own: Sequence[MethodResult], names: Sequence[str]) -> Iterator[str]:
    """The method with the least errors from sets of a design, and its errors."""
    able = [r for r in own if r.method.channels and np.isfinite(r.rmse_over_prior).all()]
    if able:
        best = min(able, key=lambda r: float(r.rmse_over_prior.mean()))
        errors = ", ".join(
            f"{format_quantity(ratio, 'share', digits=2)} ({name.replace('_', ' ')})"
            for name, ratio in zip(names, best.rmse_over_prior, strict=True)
        )
        yield (
            f"From {own[0].design}, {best.method.label} is best: RMSE {errors} of the prior's "
            "deviation."
        )
