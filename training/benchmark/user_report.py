"""The benchmark's table, picture and page."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from soilml.io.atomic_files import replacing
from soilml.io.text_tables import aligned
from soilml.quantities import QUANTITIES
from training.benchmark.methods import ANALYTIC
from training.benchmark.user_comparison import Line

#: Unit for people: factor and name.
_SHOWN = {"Pa": (1e-3, "kPa"), "rad": (180.0 / math.pi, "deg"), "m": (1e3, "mm")}


def columns(lines: Sequence[Line], names: Sequence[str]) -> dict[str, list[Any]]:
    """The table for programs: one row for each method, size of set and parameter."""
    found: dict[str, list[Any]] = {}
    for line in lines:
        for k, name in enumerate(names):
            row = {
                "rows_in_set": line.rows,
                "method": line.method,
                "inputs": line.inputs,
                "parameter": QUANTITIES[name].column,
                "sets": line.sets,
                "failed": line.failed,
                "rmse": float(line.rmse[k]),
                "rmse_share_of_prior": float(line.relative[k]),
                "cover50": float(line.cover50[k]),
                "cover90": float(line.cover90[k]),
                "seconds_per_estimate": line.seconds,
            }
            for key, value in row.items():
                found.setdefault(key, []).append(value)
    return found


def table(lines: Sequence[Line], names: Sequence[str]) -> str:
    """The table for people, a block for each size of set."""
    blocks = []
    for size in sorted({line.rows for line in lines}):
        header = ["method", "inputs"]
        for name in names:
            unit = _SHOWN.get(QUANTITIES[name].unit, (1.0, QUANTITIES[name].unit))[1]
            symbol = QUANTITIES[name].symbol
            header += [f"{symbol} RMSE {unit}", "/prior", "90 % holds"]
        header += ["failed", "ms"]
        rows = []
        for line in (entry for entry in lines if entry.rows == size):
            row = [line.method, line.inputs]
            for k, name in enumerate(names):
                factor = _SHOWN.get(QUANTITIES[name].unit, (1.0, ""))[0]
                if np.isnan(line.rmse[k]):
                    row += ["", "", ""]
                else:
                    row += [
                        f"{line.rmse[k] * factor:.3g}",
                        f"{line.relative[k]:.3f}",
                        f"{line.cover90[k]:.0%}",
                    ]
            ms = f"{1e3 * line.seconds:.2g}" if line.seconds else ""
            rows.append([*row, f"{line.failed}/{line.sets}", ms])
        what = "one reading alone" if size == 1 else f"{size} readings of one soil together"
        blocks.append(f"{what}\n\n{aligned(header, rows, text_columns=2)}")
    return "\n\n".join(blocks)


def draw(lines: Sequence[Line], names: Sequence[str], path: str | os.PathLike[str]) -> None:
    """Error against the prior's spread, and what the 90 % intervals hold, as PNG."""
    from matplotlib.figure import Figure

    sizes = sorted({line.rows for line in lines})
    methods = list(dict.fromkeys(line.method for line in lines))
    figure = Figure(figsize=(3.9 * len(names), 6.4), layout="constrained")
    axes = figure.subplots(2, len(names), squeeze=False, sharex=True)
    colours = {m: f"C{i}" for i, m in enumerate(m for m in methods if m != "prior")}
    for k, name in enumerate(names):
        for method in methods:
            own = [line for line in lines if line.method == method]
            place = [sizes.index(line.rows) for line in own]
            off = (
                0.09 * (list(colours).index(method) - len(colours) / 2) if method in colours else 0
            )
            style = {"color": colours.get(method, "0.4"), "ms": 5}
            mark = "s" if method.startswith(ANALYTIC) else "o"
            if method == "prior":
                axes[0][k].axhline(1.0, color="0.4", lw=1, ls="--", label="prior alone")
                continue
            x = np.asarray(place) + off
            axes[0][k].plot(x, [line.relative[k] for line in own], mark, label=method, **style)
            axes[1][k].plot(x, [line.cover90[k] for line in own], mark, label=method, **style)
        axes[0][k].set_title(name.replace("_", " "))
        axes[0][k].set_ylim(bottom=0)
        axes[1][k].axhspan(0.88, 0.92, color="C2", alpha=0.2, lw=0)
        held = [line.cover90[k] for line in lines if np.isfinite(line.cover90[k])]
        axes[1][k].set_ylim(min([0.5, *held]) - 0.02, 1.02)
        axes[1][k].set_xticks(range(len(sizes)), [str(size) for size in sizes])
        axes[1][k].set_xlabel("readings of one soil in a set")
        for row in (0, 1):
            axes[row][k].grid(alpha=0.3)
    axes[0][0].set_ylabel("RMSE / prior std")
    axes[1][0].set_ylabel("truths inside the 90 % interval")
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    with replacing(path) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def page(lines: Sequence[Line], names: Sequence[str], test: str) -> str:
    """The page that stands beside table and picture."""
    single = [
        line
        for line in lines
        if line.rows == 1 and line.method != "prior" and np.isfinite(line.relative).all()
    ]
    best = min(single, key=lambda line: float(line.relative.mean()))
    shares = ", ".join(f"{n.replace('_', ' ')} {best.relative[k]:.0%}" for k, n in enumerate(names))
    return (
        f"# Comparison on {test}\n\n"
        f"One reading alone: the best method ({best.method}) leaves an error of {shares} of the "
        "prior's spread. One equation cannot fix three unknowns: what is missing is filled by the "
        "prior, and the intervals must say so.\n\n"
        "RMSE is over all sets; a failed fit counts as the prior's mean, and values outside the "
        "prior are moved to its edge. `/prior` is RMSE over the prior's standard deviation, `90 % "
        "holds` the share of truths inside the 90 % interval of the sets answered. Methods marked "
        "`K given` or `c given` take that value from the model file.\n\n"
        f"![comparison](compare.png)\n\n```\n{table(lines, names)}\n```\n"
    )
