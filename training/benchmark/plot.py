"""The benchmark's picture: errors and coverage against the number of rows."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from soilml.io.atomic_files import replacing
from training.benchmark.acceptance import HELD, SHOWN
from training.benchmark.methods import ANALYTIC, PRIOR
from training.benchmark.paired_results import Result

#: Titles of the columns.
NAMES = ("cohesion", "friction angle", "shear modulus")


def draw(results: Sequence[Result], limit: str, path: str | os.PathLike[str]) -> None:
    """RMSE at one load and at three, and what 90 % intervals hold, as PNG."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    known = [r for r in results if not r.effect]
    methods = list(dict.fromkeys(r.method for r in known))
    coloured = [m for m in methods if m not in (limit, PRIOR)]
    colours = {m: f"C{i % 10}" for i, m in enumerate(coloured)} | {limit: "k", PRIOR: "0.6"}
    figure = Figure(figsize=(12.5, 12.0), layout="constrained")
    axes = figure.subplots(4, 3, sharex=True, height_ratios=[1.3, 1.3, 0.8, 0.8])
    sizes = sorted({r.design.rows for r in known})
    for k, (factor, unit) in enumerate(SHOWN):
        for half, wanted in enumerate((1, 3)):
            error, cover = axes[half][k], axes[2 + half][k]
            for method in methods:
                own = [r for r in known if r.method == method and r.design.loads in (0, wanted)]
                own += [r for r in known if r.method == method and r.design.rows == 1][:half]
                own.sort(key=lambda r: r.design.rows)
                x = [sizes.index(r.design.rows) for r in own]
                style = _style(method, limit, colours)
                error.plot(x, [r.rmse[k] * factor for r in own], label=method, **style)
                if method != PRIOR:
                    cover.plot(x, [r.cover90[k] for r in own], **style)
            error.set_yscale("log")
            error.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            error.yaxis.set_minor_formatter(NullFormatter())
            error.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
            error.grid(alpha=0.3, which="both")
            cover.axhspan(*HELD, color="C2", alpha=0.2, lw=0)
            cover.set_ylim(0.28, 1.02)
            cover.grid(alpha=0.3)
            loads = "one load" if wanted == 1 else "three loads"
            error.set_title(f"{NAMES[k]}, {loads}", fontsize=10)
            cover.set_title(f"{NAMES[k]}, {loads}", fontsize=10)
            error.set_ylabel(f"RMSE, {unit}")
            cover.set_ylabel("in the 90 % interval")
        lower = min(a.get_ylim()[0] for a in (axes[0][k], axes[1][k]))
        upper = max(a.get_ylim()[1] for a in (axes[0][k], axes[1][k]))
        for a in (axes[0][k], axes[1][k]):
            a.set_ylim(lower, upper)
    for a in axes[3]:
        a.set_xticks(range(len(sizes)), [str(size) for size in sizes])
        a.set_xlabel("rows of one soil (18: 6 slips x 3 loads)")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=9)
    with replacing(path) as part:
        figure.savefig(part, format="png", dpi=100, metadata={"Software": "soilml"})


def _style(method: str, limit: str, colours: dict[str, str]) -> dict[str, Any]:
    if method == limit:
        return {"color": "k", "lw": 4.5, "alpha": 0.85, "zorder": 1}
    if method == PRIOR:
        return {"color": "0.6", "lw": 2, "ls": ":"}
    mark = {"marker": "s", "ls": "--"} if method.startswith(ANALYTIC) else {"marker": "o"}
    return {"color": colours[method], "lw": 1.3, "ms": 4, "zorder": 3, **mark}
