"""The benchmark's figure: RMSE and coverage against the number of rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from soilml.report.figure_style import take_axes
from training.benchmark.acceptance import COVERAGE_RANGE
from training.benchmark.methods import MethodKind
from training.benchmark.paired_results import PairedResult
from training.benchmark.table_format import SHEAR_UNITS

#: Titles of the columns.
TITLES = ("cohesion c", "friction angle phi", "shear modulus K")


#: Width and height of the figure, inches.
SIZE = (12.5, 12.0)


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
