"""Tables, figure and page of the benchmark."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import QUANTITIES, SHEAR
from soilml.remarks import Remark
from soilml.report.figure_style import PRIOR, take_axes
from soilml.report.report import MOST_LINES, Picture, Report
from soilml.report.tables import Column, ReportTable
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
            coverage.axhspan(*COVERAGE_RANGE, color="C2", alpha=0.2, lw=0)
            coverage.set_ylim(0.28, 1.02)
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
    for panel in axes[0]:
        panel.legend(ncols=2, fontsize=7)
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
            styles[method] = {"color": PRIOR, "lw": 2, "ls": ":"}
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


def benchmark_tables(results: Sequence[PairedResult]) -> Iterator[ReportTable]:
    """A table for each design, then those with an effect that no method models."""
    for same in _by_design([r for r in results if not r.effect]):
        yield _table(f"{same[0].design.description} ({same[0].sets} sets)", same)
        if same[0].design.rows == LARGEST_SET:
            low, high = COHESION_RANGE
            truth = same[0].truth[:, SHEAR.index("cohesion")]
            inside = (truth >= low) & (truth <= high)
            if inside.sum() > 1:
                title = (
                    f"Of these, c {low / 1e3:g} to {high / 1e3:g} kPa ({int(inside.sum())} sets)"
                )
                yield _table(title, [r.subset(inside) for r in same])
    for same in _by_design([r for r in results if r.effect]):
        title = f"{same[0].design.description}, simulated with {same[0].effect}, which no method "
        yield _table(f"{title}models ({same[0].sets} sets)", same)


def goals_table(found: Sequence[Goal]) -> ReportTable:
    """The acceptance goals, each with the figure that was measured."""
    return ReportTable(
        "Acceptance goals",
        [
            Column("result", ["met" if goal.met else "MISSED" for goal in found]),
            Column("method", [goal.method for goal in found]),
            Column("measured", [goal.measured for goal in found]),
            Column("std error", [goal.standard_error for goal in found]),
            Column("Bayes limit", [goal.limit for goal in found]),
            Column("goal", [goal.criterion for goal in found]),
        ],
    )


def _by_design(results: Sequence[PairedResult]) -> list[list[PairedResult]]:
    groups: dict[tuple[str, str], list[PairedResult]] = {}
    for r in results:
        groups.setdefault((r.effect, r.design.key), []).append(r)
    return list(groups.values())


def _table(title: str, same: Sequence[PairedResult]) -> ReportTable:
    """A row for each method; with an unmodelled effect the posterior is no limit."""
    columns = [Column("method", [r.method for r in same])]
    for k, (symbol, name) in enumerate(zip(SHEAR_SYMBOLS, SHEAR, strict=True)):
        unit = QUANTITIES[name].unit
        columns.append(Column(symbol, [r.rmse[k] for r in same], unit, digits=3))
        if not same[0].effect:
            ratio, error = (
                [getattr(r, own)[k] for r in same] for own in ("rmse_ratio", "rmse_ratio_std")
            )
            prior = [r.rmse_over_prior[k] for r in same]
            columns.append(Column("/prior", prior, digits=3))
            columns.append(Column("/limit", ratio, std=np.nan_to_num(error).tolist(), digits=4))
            columns.append(Column("in 50 %", [r.coverage50[k] for r in same], "share", digits=2))
        columns.append(Column("in 90 %", [r.coverage90[k] for r in same], "share", digits=2))
    columns += [
        Column("joint", [r.joint_coverage90 for r in same], "share", digits=2),
        Column("log p", [r.log_score for r in same], digits=3),
        Column("failed", [r.failed for r in same]),
        Column("flagged", [r.flagged_fraction for r in same], "share", digits=2),
        Column("ms", [1e3 * r.estimates.seconds for r in same], digits=2),
    ]
    return ReportTable(title, columns)


#: Columns of the tables, explained.
LEGEND = (
    (
        "c, phi, K",
        "RMSE of cohesion, friction angle and shear modulus over all sets; a failed estimate "
        "counts as the prior's median, and estimates outside the prior are clipped to it.",
    ),
    ("/prior", "RMSE over the prior's standard deviation."),
    (
        "/limit",
        "RMSE over that of the exact posterior mean on the same sets, and its standard error "
        "(paired jackknife over sets).",
    ),
    (
        "in 50 %, in 90 %",
        "coverage of the method's own 50 and 90 % intervals, of the sets answered.",
    ),
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
    """The report of the benchmark."""
    found = goals(results)
    met = sum(goal.met for goal in found)
    methods = {r.method for r in results if not r.effect}
    verdict = f"{met} of {len(found)} acceptance goals are met."
    missed = [
        f"Missed: {g.method}: {g.criterion} (measured {g.measured})." for g in found if not g.met
    ]
    return Report(
        kind="compare",
        verdict=verdict,
        lines=missed[:MOST_LINES],
        tables=[goals_table(found), *benchmark_tables(results)],
        pictures=[
            Picture(
                "Errors and coverage", partial(plot_benchmark, results), 4, 3, SIZE, verdict,
                "RMSE (upper rows, logarithmic) and coverage of 90 % intervals (lower rows; green: "
                "88 to 92 %) against the number of rows per set, at one load and at three. Thick: "
                "the Bayes limit. Dotted: the prior. Dashed: analytic methods.",
            )
        ],
        remarks=[
            Remark(
                "simulated-by-the-model",
                "the sets are simulated by the model: no error of the model is in these figures",
                severity="note",
            )
        ],
        next_steps=["soilml compare MODEL.toml TEST.parquet MODEL.onnx for data of your own"],
        status=f"{met} of {len(found)} goals",
        tone="good" if met == len(found) else "warn",
        title="Benchmark of methods relative to the Bayes limit",
        basis=f"{len(methods)} methods on fixed sets of simulated readings",
        notation=LEGEND,
    )  # fmt: skip
