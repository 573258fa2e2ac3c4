"""Tables, figure and page of the benchmark."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from numpy.typing import NDArray

from soilml.io.text_tables import format_table
from soilml.quantities import QUANTITIES, SHEAR
from soilml.remarks import Remark
from soilml.report.figure_style import picture, take_axes
from soilml.report.page import Report, ReportPicture, ReportTable
from training.benchmark.acceptance import (
    COHESION_RANGE,
    COVERAGE_RANGE,
    LARGEST_SET,
    SHEAR_SYMBOLS,
    SHEAR_UNITS,
    Goal,
    goals,
)
from training.benchmark.methods import MethodKind
from training.benchmark.paired_results import PairedResult


def format_number(value: float, form: str) -> str:
    """The number in a format; NaN gives a blank cell."""
    return "" if math.isnan(value) else format(value, form)


def columns_of_rows(rows: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows with equal keys as columns, in the order of the keys."""
    columns: dict[str, list[Any]] = {}
    for row in rows:
        for key, value in row.items():
            columns.setdefault(key, []).append(value)
    return columns


TITLES = ("cohesion c", "friction angle phi", "shear modulus K")  # Titles of the columns


SIZE = (12.5, 12.0)  # Width and height of the figure, inches


def plot_benchmark(results: Sequence[PairedResult], ax: Any = None) -> NDArray[Any]:
    """Draw the RMSE at one load and at three, and the coverage of 90 % intervals.

    `ax` takes 12 axes, in 4 rows of 3; a new figure where None. Returns them, (4, 3).
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    modelled = [r for r in results if not r.effect]
    kinds = {r.method: r.kind for r in modelled}
    axes = take_axes(ax, 4, 3, SIZE)
    sizes = sorted({r.design.rows for r in modelled})
    styles = _styles(kinds)
    for k, (factor, unit) in enumerate(SHEAR_UNITS):
        for half, loads in enumerate((1, 3)):
            error, coverage = axes[half][k], axes[2 + half][k]
            for method, kind in kinds.items():
                own = [r for r in modelled if r.method == method and r.design.loads in (0, loads)]
                # single rows have one load: they start the curves of three loads as well
                own += [r for r in modelled if r.method == method and r.design.rows == 1][:half]
                own.sort(key=lambda r: r.design.rows)
                x = [sizes.index(r.design.rows) for r in own]
                error.plot(x, [r.rmse[k] * factor for r in own], label=method, **styles[method])
                if kind is not MethodKind.PRIOR:
                    coverage.plot(x, [r.coverage90[k] for r in own], **styles[method])
            error.set_yscale("log")
            error.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            error.yaxis.set_minor_formatter(NullFormatter())
            error.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
            error.grid(alpha=0.3, which="both")
            coverage.axhspan(*COVERAGE_RANGE, color="C2", alpha=0.2, lw=0)
            coverage.set_ylim(0.28, 1.02)
            coverage.grid(alpha=0.3)
            title = f"{TITLES[k]}, {'one load' if loads == 1 else 'three loads'}"
            error.set_title(title, fontsize=10)
            coverage.set_title(title, fontsize=10)
            error.set_ylabel(f"RMSE ({unit})")
            coverage.set_ylabel("coverage of 90 % interval")
        lower = min(a.get_ylim()[0] for a in (axes[0][k], axes[1][k]))
        upper = max(a.get_ylim()[1] for a in (axes[0][k], axes[1][k]))
        for a in (axes[0][k], axes[1][k]):
            a.set_ylim(lower, upper)
    for a in axes[3]:
        a.set_xticks(range(len(sizes)), [str(size) for size in sizes])
        a.set_xlabel("rows per set (18: 6 slips x 3 loads)")
    for a in axes[:3].flat:
        a.set_xticks(range(len(sizes)), [""] * len(sizes))
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure = axes[0][0].figure
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=9)
    return axes


def _styles(kinds: dict[str, MethodKind]) -> dict[str, dict[str, Any]]:
    """Line style by method: the limit black, the prior grey, analytic methods dashed."""
    styles: dict[str, dict[str, Any]] = {}
    number = 0
    for method, kind in kinds.items():
        if kind is MethodKind.BAYES_LIMIT:
            styles[method] = {"color": "k", "lw": 4.5, "alpha": 0.85, "zorder": 1}
            continue
        if kind is MethodKind.PRIOR:
            styles[method] = {"color": "0.6", "lw": 2, "ls": ":"}
            continue
        analytic = kind is MethodKind.ANALYTIC
        marker = {"marker": "s", "ls": "--"} if analytic else {"marker": "o"}
        styles[method] = {"color": f"C{number % 10}", "lw": 1.3, "ms": 4, "zorder": 3, **marker}
        number += 1
    return styles


def csv_columns(results: Sequence[PairedResult]) -> dict[str, list[Any]]:
    """The CSV table, in SI units: one row per design, effect, method and parameter."""
    return columns_of_rows(_csv_row(r, k) for r in results for k in range(len(SHEAR)))


def _csv_row(r: PairedResult, k: int) -> dict[str, Any]:
    # with an unmodelled effect the posterior is no limit: no ratio to it
    ratio, ratio_std = (
        (float("nan"), float("nan")) if r.effect else (r.rmse_ratio[k], r.rmse_ratio_std[k])
    )
    return {
        "design": r.design.key,
        "rows_in_set": r.design.rows,
        "loads_in_set": r.design.loads,
        "unknown_effect": r.effect,
        "method": r.method,
        "inputs": r.inputs,
        "parameter": QUANTITIES[SHEAR[k]].column,
        "sets": r.sets,
        "failed": r.failed,
        "rmse": float(r.rmse[k]),
        "rmse_share_of_prior": float(r.rmse_over_prior[k]),
        "rmse_over_limit": float(ratio),
        "rmse_over_limit_std": float(ratio_std),
        "cover50": float(r.coverage50[k]),
        "cover90": float(r.coverage90[k]),
        "joint_cover90": r.joint_coverage90,
        "log_density": r.log_score,
        "flagged": r.flagged_fraction,
        "seconds_per_estimate": r.estimates.seconds,
    }


def format_tables(results: Sequence[PairedResult]) -> str:
    """A text table for each design, then those with an unmodelled effect."""
    blocks = []
    for same in _by_design([r for r in results if not r.effect]):
        blocks.append(f"{same[0].design.description} ({same[0].sets} sets)\n\n{_full_table(same)}")
        if same[0].design.rows == LARGEST_SET:
            blocks.append(_table_of_cohesion_range(same))
    for same in _by_design([r for r in results if r.effect]):
        first = same[0]
        title = f"{first.design.description}, simulated with {first.effect}, which no method models"
        blocks.append(f"{title} ({first.sets} sets)\n\n{_short_table(same)}")
    return "\n\n".join(blocks)


def _table_of_cohesion_range(same: Sequence[PairedResult]) -> str:
    """The same table of the sets whose true cohesion is in the range of a goal."""
    low, high = COHESION_RANGE
    truth = same[0].truth[:, SHEAR.index("cohesion")]
    inside = (truth >= low) & (truth <= high)
    if inside.sum() < 2:
        return f"fewer than two sets with c {low / 1e3:g} to {high / 1e3:g} kPa"
    title = f"of these, c {low / 1e3:g} to {high / 1e3:g} kPa ({int(inside.sum())} sets)"
    return f"{title}\n\n{_full_table([r.subset(inside) for r in same])}"


_GOAL_HEADER = ("goal", "method", "measured", "std error", "Bayes limit", "result")


def _goal_rows(found: Sequence[Goal]) -> list[list[str]]:
    return [
        [g.criterion, g.method, g.measured, g.standard_error, g.limit, "met" if g.met else "MISSED"]
        for g in found
    ]


def format_goals(found: Sequence[Goal]) -> str:
    """The acceptance goals, each with the figure that was measured."""
    return format_table(_GOAL_HEADER, _goal_rows(found), text_columns=len(_GOAL_HEADER))


def short_goals(found: Sequence[Goal]) -> str:
    """The same for a terminal."""
    rows = [
        ["met" if g.met else "MISSED", g.method, g.measured.split(" (")[0], g.criterion]
        for g in found
    ]
    return format_table(("result", "method", "measured", "goal"), rows, text_columns=4)


def short_tables(results: Sequence[PairedResult]) -> str:
    """The tables of a terminal: errors, ratios to the limit, and coverage."""
    blocks = []
    for same in _by_design(results):
        title = f"{same[0].design.description} ({same[0].sets} sets)"
        if same[0].effect:
            title += f"\nsimulated with {same[0].effect}, which no method models"
            blocks.append(f"{title}\n\n{_short_table(same)}")
            continue
        hidden = {"/prior", "s.e.", "50 %", "joint", "log p", "failed", "flagged"}
        blocks.append(f"{title}\n\n{format_table(*_without(*_full_rows(same), hidden))}")
    return "\n\n".join(blocks)


def _by_design(results: Sequence[PairedResult]) -> list[list[PairedResult]]:
    groups: dict[tuple[str, str], list[PairedResult]] = {}
    for r in results:
        groups.setdefault((r.effect, r.design.key), []).append(r)
    return list(groups.values())


def _full_table(same: Sequence[PairedResult]) -> str:
    return format_table(*_full_rows(same))


def _short_table(same: Sequence[PairedResult]) -> str:
    return format_table(*_short_rows(same))


def _full_rows(same: Sequence[PairedResult]) -> tuple[list[str], list[list[str]]]:
    header = ["method"]
    for symbol, (_, unit) in zip(SHEAR_SYMBOLS, SHEAR_UNITS, strict=True):
        header += [f"{symbol} {unit}", "/prior", "/limit", "s.e.", "50 %", "90 %"]
    header += ["joint", "log p", "failed", "flagged", "ms"]
    rows = []
    for r in same:
        row = [r.method]
        for k, (factor, _) in enumerate(SHEAR_UNITS):
            row += [
                format_number(r.rmse[k] * factor, ".3g"),
                format_number(r.rmse_over_prior[k], ".3f"),
                format_number(r.rmse_ratio[k], ".3f"),
                format_number(r.rmse_ratio_std[k], ".3f"),
                format_number(r.coverage50[k], ".0%"),
                format_number(r.coverage90[k], ".0%"),
            ]
        row += [format_number(r.joint_coverage90, ".0%"), format_number(r.log_score, ".3g")]
        row += [str(r.failed or ""), f"{r.flagged_fraction:.1%}" if r.flagged_fraction else ""]
        rows.append([*row, format_number(1e3 * r.estimates.seconds, ".2g")])
    return header, rows


def _short_rows(same: Sequence[PairedResult]) -> tuple[list[str], list[list[str]]]:
    return _without(*_full_rows(same), {"/prior", "/limit", "s.e.", "50 %", "log p", "ms"})


def _without(
    header: list[str], rows: list[list[str]], hidden: set[str]
) -> tuple[list[str], list[list[str]]]:
    """A table without the columns of some names."""
    kept = [i for i, name in enumerate(header) if name not in hidden]
    return [header[i] for i in kept], [[row[i] for i in kept] for row in rows]


#: Columns of the tables, explained.
LEGEND = (
    (
        "c, phi, K",
        "RMSE of cohesion, friction angle and shear modulus over all sets; a failed estimate "
        "counts as the prior's median, and estimates outside the prior are clipped to it.",
    ),
    ("/prior", "RMSE over the prior's standard deviation."),
    (
        "/limit, s.e.",
        "RMSE over that of the exact posterior mean on the same sets, and its standard error "
        "(paired jackknife over sets).",
    ),
    ("50 %, 90 %", "coverage of the method's own 50 and 90 % intervals, of the sets answered."),
    ("joint", "coverage of the 90 % ellipsoid of its mean and covariance."),
    (
        "log p",
        "mean log posterior density at the truth (nat; parameters as fractions of their priors, so "
        "that the prior has 0; in expectation no method exceeds the limit).",
    ),
    ("failed", "number of sets without an estimate."),
    (
        "flagged",
        "sets whose estimate the method itself reports as unreliable (readings out of range, or "
        "residuals larger than the noise explains).",
    ),
    ("ms", "wall time of one estimate."),
    (
        "linear, newton",
        "linear fixes K and newton fixes c at the value of the recipe's nominal soil, not at the "
        "truth; both read sinkage as well.",
    ),
)


def benchmark_report(results: Sequence[PairedResult]) -> Report:
    """The page of the benchmark."""
    found = goals(results)
    met = sum(goal.met for goal in found)
    methods = {r.method for r in results if not r.effect}
    answer = [f"{met} of {len(found)} acceptance goals are met."]
    answer += [
        f"Missed: {g.method}: {g.criterion} (measured {g.measured})." for g in found if not g.met
    ]
    figure = ReportPicture(
        "Errors and coverage",
        picture(partial(plot_benchmark, results), 4, 3, SIZE, answer[0]),
        "RMSE (upper rows, logarithmic) and coverage of 90 % intervals (lower rows; green: 88 to "
        "92 %) against the number of rows per set, at one load and at three. Black: the Bayes "
        "limit. Dotted: the prior. Dashed: analytic methods.",
    )
    tables = [ReportTable("Acceptance goals", _GOAL_HEADER, _goal_rows(found), len(_GOAL_HEADER))]
    for same in _by_design(results):
        title = f"{same[0].design.description} ({same[0].sets} sets)"
        if same[0].effect:
            title += f", simulated with {same[0].effect}, which no method models"
            tables.append(ReportTable(title, *_short_rows(same)))
        else:
            tables.append(ReportTable(title, *_full_rows(same)))
    return Report(
        kind="compare",
        title="Benchmark of methods relative to the Bayes limit",
        badge=f"{met} of {len(found)} goals",
        meaning=f"{len(methods)} methods on fixed sets of simulated readings",
        answer=answer[:MOST_SENTENCES],
        tone="no-gap" if met == len(found) else "suspected",
        pictures=[figure],
        tables=tables,
        warnings=[
            Remark(
                "simulated-by-the-model",
                "The sets are simulated by the model: no error of the model is in these figures.",
                severity="note",
            )
        ],
        next_steps=["soilml compare MODEL.toml TEST.parquet MODEL.onnx for data of your own."],
        notation=LEGEND,
    )


MOST_SENTENCES = 6  # Most sentences of the page; the table of goals has all
