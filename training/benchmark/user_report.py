"""Table, figure and page of a comparison on the user's test data."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.io.text_tables import format_table
from soilml.quantities import QUANTITIES
from soilml.remarks import Remark
from soilml.report.figure_style import picture, short_label, take_axes
from soilml.report.page import Report, ReportPicture, ReportTable
from soilml.report.terminal import shown_unit
from training.benchmark.acceptance import COVERAGE_RANGE
from training.benchmark.methods import MethodKind
from training.benchmark.paired_results import MethodResult
from training.benchmark.report import columns_of_rows, format_number

_MOST_NAME = 24  # Most characters of the name of a method on a terminal


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


def format_tables(scores: Sequence[MethodResult], names: Sequence[str]) -> str:
    """A text table for each size of set, without the columns that are in the file alone."""
    header, blocks = _blocks(scores, names)
    kept = [i for i, name in enumerate(header) if name not in ("inputs", "ms")]
    texts = []
    for title, rows in blocks:
        cells = [[_short(row[i]) if i == 0 else row[i] for i in kept] for row in rows]
        texts.append(f"{title}\n\n{format_table([header[i] for i in kept], cells)}")
    return "\n\n".join(texts)


def _short(method: str) -> str:
    return method if len(method) <= _MOST_NAME else f"{method[: _MOST_NAME - 3]}..."


def _blocks(
    scores: Sequence[MethodResult], names: Sequence[str]
) -> tuple[list[str], list[tuple[str, list[list[str]]]]]:
    """Header, and title and rows for each size of set."""
    header = ["method", "inputs"]
    for name in names:
        unit, symbol = shown_unit(QUANTITIES[name].unit)[1], QUANTITIES[name].symbol
        header += [f"{symbol} {unit}".rstrip(), "/prior", "90 %"]
    header += ["failed", "ms"]
    blocks = []
    for size in sorted({score.rows for score in scores}):
        rows = [_cells(score, names) for score in scores if score.rows == size]
        title = "single readings" if size == 1 else f"{size} readings of one soil"
        blocks.append((title, rows))
    return header, blocks


def _cells(score: MethodResult, names: Sequence[str]) -> list[str]:
    cells = [score.method, score.inputs]
    for k, name in enumerate(names):
        cells += [
            format_number(score.rmse[k] * shown_unit(QUANTITIES[name].unit)[0], ".3g"),
            format_number(score.rmse_over_prior[k], ".3f"),
            "" if np.isnan(score.rmse[k]) else f"{score.coverage90[k]:.0%}",
        ]
    milliseconds = f"{1e3 * score.estimates.seconds:.2g}" if score.estimates.seconds else ""
    return [*cells, f"{score.failed}/{score.sets}", milliseconds]


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
        error.axhline(1.0, color="0.4", lw=1, ls="--", label="prior")
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
        for panel in (error, coverage):
            panel.grid(alpha=0.3)
    axes[0][0].set_ylabel("RMSE / prior standard deviation")
    axes[1][0].set_ylabel("coverage of 90 % interval")
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


def figure_size(names: Sequence[str]) -> tuple[float, float]:
    """Width and height of the figure, inches."""
    return 3.9 * len(names), 6.4


def comparison_report(scores: Sequence[MethodResult], names: Sequence[str], test: str) -> Report:
    """The page of a comparison on test data of this name."""
    single = [
        score
        for score in scores
        if score.rows == 1
        and score.kind is not MethodKind.PRIOR
        and np.isfinite(score.rmse_over_prior).all()
    ]
    best = min(single, key=lambda score: float(score.rmse_over_prior.mean()))
    ratios = zip(names, best.rmse_over_prior, strict=True)
    shares = ", ".join(f"{name.replace('_', ' ')} {100 * ratio:.0f} %" for name, ratio in ratios)
    largest = max(score.rows for score in scores)
    answer = [
        f"From a single reading, the best method ({best.method}) has an RMSE, relative to the "
        f"prior's standard deviation, of: {shares}."
    ]
    if largest > 1:
        many = [s for s in scores if s.rows == largest and np.isfinite(s.rmse_over_prior).all()]
        first = min(many, key=lambda score: float(score.rmse_over_prior.mean()))
        pairs = zip(names, first.rmse_over_prior, strict=True)
        found = ", ".join(f"{name.replace('_', ' ')} {100 * x:.0f} %" for name, x in pairs)
        answer.append(f"From {largest} readings of one soil, the best is {first.method}: {found}.")
    header, blocks = _blocks(scores, names)
    return Report(
        kind="compare",
        title=f"Comparison of methods on {test}",
        badge=f"{len({s.method for s in scores})} methods",
        meaning=f"on sets of {', '.join(str(n) for n in sorted({s.rows for s in scores}))} "
        "readings whose soil is known",
        answer=answer,
        pictures=[
            ReportPicture(
                "Errors and coverage",
                picture(
                    partial(plot_comparison, scores, names), 2, len(names), figure_size(names),
                    answer[0],
                ),
                "RMSE over the prior's standard deviation (top; dashed: the prior) and coverage of "
                "90 % intervals (bottom; green: 88 to 92 %) against the number of readings per "
                "set. Squares: analytic methods.",
            )
        ],
        tables=[ReportTable(title, header, rows, 2) for title, rows in blocks],
        warnings=[
            Remark(
                "prior-supplies-information",
                "One equation does not determine three unknowns: for single readings the prior "
                "supplies the missing information, and intervals must be correspondingly wide.",
                severity="note",
            )
        ],
        next_steps=["soilml estimate MODEL.onnx RUNS.csv with the method that suits your rows."],
        notation=[
            (
                "RMSE",
                "over all sets; a failed fit counts as the prior's median, and estimates outside "
                "the prior are clipped to it.",
            ),
            ("/prior", "RMSE over the prior's standard deviation."),
            ("90 %", "coverage of the 90 % interval, of the sets answered."),
            ("failed", "sets without an estimate, of all."),
            ("ms", "wall time of one estimate."),
            ("fixed", "a parameter that a method takes from the model file."),
        ],
    )  # fmt: skip
