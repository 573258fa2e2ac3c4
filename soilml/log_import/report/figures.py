"""Pictures of the report: the runs over time, and the rows over slip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.log_import.recording import Floats
from soilml.log_import.result import ImportedLog, WheelSeries
from soilml.log_import.rows_figure import draw_over_slip, panels_over_slip
from soilml.quantities import Z_90
from soilml.report.figure_style import AFTER, SvgImage, new_figure, report_style, svg_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

#: Panels of a run: title with unit, quantities, and labels.
_PANELS = (
    ("speed, m/s", ("rim_speed", "speed"), ("rim", "travel")),
    ("slip", ("slip",), ("",)),
    ("torque, N m", ("torque",), ("",)),
    ("load, drawbar pull, N", ("load", "drawbar_pull"), ("load", "pull")),
    ("sinkage, mm", ("sinkage",), ("",)),
)
_COLUMNS = {"slip": "slip", "torque": "torque_Nm", "load": "load_N",
            "drawbar_pull": "drawbar_pull_N", "sinkage": "sinkage_m"}  # fmt: skip
_LINES = (AFTER, "#cc7a00")
#: Most points of a line; a longer one is drawn by the extremes of its parts.
_MOST_POINTS = 700
_WINDOW, _LEFT_OUT, _HEIGHT = "#dbe9f4", "#eeeeee", 74


def run_figure(series: WheelSeries, imported: ImportedLog) -> SvgImage:
    """The channels of a run over time; windows are shaded, with their means and 90 % intervals."""
    with report_style():
        canvas = new_figure(_HEIGHT * len(_panels(series)) + 46)
        draw_run(canvas, series, imported)
        kept = sum(not s.why for s in series.stretches)
        return svg_image(canvas, f"run {series.run}: {kept} steady windows")


def _panels(series: WheelSeries) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    return [panel for panel in _PANELS if any(_finite(series, name) for name in panel[1])]


def draw_run(canvas: FigureBase, series: WheelSeries, imported: ImportedLog) -> None:
    """Draw the panels of a run into a matplotlib figure."""
    panels = _panels(series)
    height = _HEIGHT * len(panels) + 46.0
    rows = imported.table.rows(imported.table["run"] == series.run)
    for k, (title, names, labels) in enumerate(panels):
        top = height - 16 - _HEIGHT * k
        axes = canvas.add_axes((0.13, (top - _HEIGHT + 18) / height, 0.85, (_HEIGHT - 18) / height))
        for s in series.stretches:
            axes.axvspan(s.start, s.stop, color=_LEFT_OUT if s.why else _WINDOW, lw=0, zorder=0)
        scale = 1e3 if title.endswith("mm") else 1.0
        shown: list[Floats] = []
        for name, label, colour in zip(names, labels, _LINES, strict=False):
            if not _finite(series, name):
                continue
            values = scale * series.quantities[name]
            if name == "slip":
                values = np.where(_turning(series), values, np.nan)
            moving = values
            shown.append(moving[np.isfinite(moving)])
            axes.plot(*_thinned(series.time, values), color=colour, lw=0.7, alpha=0.65)
            if label:
                axes.plot([], [], color=colour, label=label)
            _draw_means(axes, rows, name, scale, colour)
        _limits(axes, shown)
        axes.set_title(title, fontsize=9.5, pad=3)
        axes.tick_params(labelsize=8.5, labelbottom=k == len(panels) - 1)
        axes.set_xlim(series.time[0], series.time[-1])
        axes.locator_params(axis="y", nbins=4)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(
                fontsize=8, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 0.93), ncols=2,
                handlelength=1.2, borderpad=0.0, borderaxespad=0.0,
            )  # fmt: skip
    axes.set_xlabel("time, s", fontsize=9.5)


def _draw_means(axes: Axes, rows: Any, name: str, scale: float, colour: str) -> None:
    key = _COLUMNS.get(name)
    if key is None or key not in rows or not len(rows):
        return
    std = rows[f"{key}_std"] if f"{key}_std" in rows else np.zeros(len(rows))
    axes.errorbar(
        rows["time_s"], scale * rows[key], Z_90 * scale * np.nan_to_num(std), fmt="o", ms=3.2,
        color="black", ecolor="black", elinewidth=1.2, capsize=2, zorder=4,
    )  # fmt: skip


def _limits(axes: Axes, shown: list[Floats]) -> None:
    """Limits by percentiles, so that a single spike does not flatten the rest."""
    values = np.concatenate(shown) if shown else np.zeros(0)
    if values.size:
        low, high = np.percentile(values, [0.5, 99.5])
        low, high = min(low, 0.0), max(high, 0.0)
        margin = 0.08 * (high - low) or 1.0
        axes.set_ylim(low - margin, high + margin)


def _finite(series: WheelSeries, name: str) -> bool:
    values = series.quantities.get(name)
    return values is not None and bool(np.isfinite(values).any())


def _turning(series: WheelSeries) -> NDArray[np.bool_]:
    """Where the wheel turns, (n,): slip is noise where it does not."""
    rim = series.quantities.get("rim_speed")
    if rim is None or not np.isfinite(rim).any():
        return np.ones(series.time.size, dtype=bool)
    size = np.abs(np.nan_to_num(rim))
    return np.asarray(size > 0.2 * np.percentile(size, 90))


def _thinned(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """A line of few points that keeps the extremes of each part."""
    width = -(-time.size // (_MOST_POINTS // 2))
    if width < 3:
        return time, values
    count = time.size // width
    blocks = values[: count * width].reshape(count, width)
    known = np.isfinite(blocks)
    low = np.where(known.any(axis=1), np.where(known, blocks, np.inf).min(axis=1), np.nan)
    high = np.where(known.any(axis=1), np.where(known, blocks, -np.inf).max(axis=1), np.nan)
    places = time[: count * width].reshape(count, width)
    x = np.stack([places[:, 0], places[:, width // 2]], axis=1).reshape(-1)
    return x, np.stack([low, high], axis=1).reshape(-1)


def slip_figures(imported: ImportedLog) -> list[SvgImage]:
    """The rows over slip: T / (W r) or torque, drawbar pull over load, sinkage; 90 % intervals."""
    found = []
    with report_style():
        for panel in panels_over_slip(imported.table, imported.radius):
            canvas = new_figure(250)
            draw_over_slip(canvas.add_axes((0.14, 0.17, 0.83, 0.72)), imported.table, panel)
            found.append(
                svg_image(canvas, f"{panel.title} of {len(imported.table)} rows over slip")
            )
    return found
