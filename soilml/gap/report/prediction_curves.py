"""Section "Measured and predicted": readings, predictions and residuals over slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.levels import load_levels
from soilml.gap.report.results import ReadingsAndPredictions
from soilml.quantities import Z_90
from soilml.report.figure_style import AFTER, BEFORE, SvgImage, new_figure, report_style, svg_image
from soilml.report.numbers import channel_name, channel_unit, format_number, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Rows = NDArray[np.bool_]

#: Colours of loads from light to heavy (the colour map plasma without its yellow), and markers that
#: distinguish the runs in grey prints.
LOAD_COLOURS = ("#0d0887", "#5c01a6", "#9c179e", "#cc4778", "#e0603f", "#d98300")
MARKERS = ("o", "s", "^", "D", "v", "P")
#: Outlines of the markers in the legend, in a box of 16 by 16.
_MARKER_PATHS = {
    "o": "M8 3a5 5 0 1 0 .01 0z",
    "s": "M3 3h10v10h-10z",
    "^": "M8 2l6 11h-12z",
    "D": "M8 1.5l6.5 6.5l-6.5 6.5l-6.5 -6.5z",
    "v": "M8 14l6 -11h-12z",
    "P": "M6 2h4v4h4v4h-4v4h-4v-4h-4v-4h4z",
}
#: Most runs in a figure, and the least ratio of the load of one to that of the next.
MOST_RUNS, LEAST_RATIO = 4, 1.05


def prediction_curves(curves: ReadingsAndPredictions, changed: bool) -> dict[str, Any]:
    """A figure for each channel, and the legend of the runs."""
    runs, parts = select_runs(curves), runs_at_one_load(curves)
    return {
        "panels": [_channel_figure(curves, i, runs, changed) for i in range(len(curves.channels))],
        "runs": [_legend_entry(run) for run in runs],
        "of": len(parts),
        "several_loads": len(parts) > len(set(curves.run)),
    }


@dataclass(frozen=True)
class ShownRun:
    """A run in the figure, at one level of load: its name, its load (N), colour and marker."""

    run: str
    load: float
    colour: str
    marker: str
    rows: Rows


def runs_at_one_load(curves: ReadingsAndPredictions) -> dict[tuple[str, float], Rows]:
    """Readings (m,) of each run at each of its loads, by the run and the median load (N).

    A line through all readings of a run would jump between its loads. Loads of which each has
    several slips were set; others count by their levels.
    """
    names, found = np.asarray(curves.run), {}
    for run in dict.fromkeys(curves.run):
        own = names == run
        driven = np.unique(np.stack([curves.load[own], curves.slip[own]]), axis=1)
        loads, slips = np.unique(driven[0], return_counts=True)
        number = np.arange(len(loads)) if slips.min() > 1 else load_levels(loads).index
        for k in range(int(number.max()) + 1):
            rows = own & np.isin(curves.load, loads[number == k])
            found[str(run), float(np.median(curves.load[rows]))] = rows
    return found


def select_runs(curves: ReadingsAndPredictions) -> list[ShownRun]:
    """Runs spread over the measured loads, the lightest first.

    Bands of runs at nearly one load would cover each other: the first of them stands for all. The
    residuals are those of all runs.
    """
    parts = runs_at_one_load(curves)
    options: list[tuple[float, str]] = []
    for load, run in sorted((load, run) for run, load in parts):
        if not options or load > LEAST_RATIO * options[-1][0]:
            options.append((load, run))
    picked = np.unique(np.linspace(0, len(options) - 1, MOST_RUNS).round().astype(int))
    colours = np.linspace(0, len(LOAD_COLOURS) - 1, len(picked)).round().astype(int)
    shown = [options[i] for i in picked]
    return [
        ShownRun(run, load, LOAD_COLOURS[k], MARKERS[j], parts[run, load])
        for j, ((load, run), k) in enumerate(zip(shown, colours, strict=True))
    ]


def _channel_figure(
    curves: ReadingsAndPredictions, number: int, runs: Sequence[ShownRun], changed: bool
) -> SvgImage:
    """One channel: readings and predictions over slip, and below them the residuals, in sigma."""
    column = curves.channels[number]
    factor, unit = channel_unit(column)
    with report_style():
        canvas = new_figure(460)
        top = canvas.add_axes((0.14, 0.47, 0.83, 0.475))
        low = canvas.add_axes((0.14, 0.1, 0.83, 0.265), sharex=top)
        for run in runs:
            here = np.flatnonzero((curves.channel == number) & run.rows)
            if here.size:
                _plot_run(
                    top, curves, here[np.argsort(curves.slip[here])], factor, run, changed=changed
                )
        top.set_title(
            with_unit(channel_name(column), f"({unit})") if unit else channel_name(column)
        )
        top.tick_params(labelbottom=False)
        top.margins(y=0.06)
        here = np.flatnonzero(curves.channel == number)
        _plot_residuals(low, curves, here, changed)
        low.set_xlabel("slip")
        for axes in (top, low):
            axes.grid(color="#e4e4e4", lw=0.7)
            axes.set_axisbelow(True)
        name = channel_name(column)
        alt = f"{name} over slip, measured and predicted, for {len(runs)} runs"
        return svg_image(canvas, alt)


def _plot_run(
    axes: Axes,
    curves: ReadingsAndPredictions,
    here: NDArray[np.int64],
    factor: float,
    run: ShownRun,
    changed: bool,
) -> None:
    slip = curves.slip[here]
    band = Z_90 * np.hypot(curves.after_std[here], curves.std[here])
    line = np.unique(slip).size > 1
    for y, dashes in ((curves.before, (4, 2.2)), (curves.after, ())):
        if dashes and not changed:
            continue
        style: dict[str, Any] = {"dashes": dashes} if dashes else {}
        axes.plot(slip, factor * y[here], "-" if line else "_", color=run.colour,
                  lw=1.1 if dashes else 1.7, ms=14, **style)  # fmt: skip
    low, high = factor * (curves.after[here] - band), factor * (curves.after[here] + band)
    if line:
        axes.fill_between(slip, low, high, color=run.colour, alpha=0.18, lw=0)
    else:
        axes.vlines(slip, low, high, color=run.colour, alpha=0.3, lw=5)
    axes.plot(slip, factor * curves.measured[here], run.marker, color=run.colour, ms=4.6, mew=1.0)


def _plot_residuals(
    axes: Axes, curves: ReadingsAndPredictions, here: NDArray[np.int64], changed: bool
) -> None:
    axes.axhspan(-Z_90, Z_90, color="#dddddd", lw=0)
    axes.axhline(0.0, color="#555555", lw=0.8)
    most = 3.5
    for y, colour, marker in ((curves.before, BEFORE, "x"), (curves.after, AFTER, "o")):
        if marker == "x" and not changed:
            continue
        residual = (curves.measured[here] - y[here]) / curves.std[here]
        size, edge = (3.4, 0.0) if marker == "o" else (4.5, 1.1)
        axes.plot(curves.slip[here], residual, marker, color=colour, ms=size, mew=edge)
        finite = np.abs(residual[np.isfinite(residual)])
        most = max(most, 1.3 * float(finite.max()) if finite.size else 0.0)
    compressed = most > 12.0
    if compressed:
        axes.set_yscale("symlog", linthresh=3.0)
        steps = [f * 10.0**d for d in range(1, 9) for f in (1.0, 3.0) if f * 10.0**d < most / 1.2]
        ticks = [3.0, *steps[-1:]]
        ticks = [-t for t in ticks] + [0.0, *ticks]
        axes.set_yticks(ticks, [format_number(t, 1) for t in ticks])
        axes.minorticks_off()
    axes.set_title("measured − predicted (σ" + (", compressed beyond 3)" if compressed else ")"))
    axes.set_ylim(-most, most)


def _legend_entry(run: ShownRun) -> dict[str, str]:
    load = f"{format_number(run.load)}\N{NO-BREAK SPACE}N"
    return {"path": _MARKER_PATHS[run.marker], "colour": run.colour, "run": run.run, "load": load}
