"""What an import says: rows, what was left out and why, what looks odd, and its pictures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.levels import load_levels
from soilml.io.table import Table
from soilml.log_import.wheel_rows import WheelSeries
from soilml.quantities import Z_90
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.figure_style import AFTER, BEFORE, PRIOR
from soilml.report.numbers import format_quantity
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from soilml.log_import.result import ImportedLog

#: Most runs of which the page has a picture; the others are in the tables.
MOST_RUNS = 24
_SHOWN = ("run", "time_s", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
#: Panels of a run: title with unit, quantities, and labels.
_PANELS = (
    ("speed, m/s", ("rim_speed", "speed"), ("rim", "travel")),
    ("slip", ("slip",), ("",)),
    ("torque, N m", ("torque",), ("",)),
    ("load, drawbar pull, N", ("load", "drawbar_pull"), ("load", "pull")),
    ("sinkage, mm", ("sinkage",), ("",)),
    ("vibration, m/s²", ("vibration",), ("",)),
)
_COLUMNS = {"slip": "slip", "torque": "torque_Nm", "load": "load_N",
            "drawbar_pull": "drawbar_pull_N", "sinkage": "sinkage_m",
            "vibration": "vibration_m_s2"}  # fmt: skip
_LINES = (AFTER, BEFORE)
#: Most points of a line; a longer one is drawn by the extremes of its parts.
_MOST_POINTS = 700
_WINDOW, _LEFT_OUT = AFTER, PRIOR


def report_of_import(found: ImportedLog) -> Report:
    """The report of an import."""
    rows, runs = len(found.table), found.runs
    odd = (*found.implausible, *found.remarks)
    if found.implausible:
        verdict, tone = f"The map looks wrong: {odd[0].text}", "bad"
        step = "correct the map, and import again"
    elif odd:
        verdict, tone = odd[0].text, "warn"
        step = "look at the remarks and the pictures; then identify the soil from the rows"
    else:
        verdict, tone = f"{rows} rows were imported, and nothing looks odd.", "good"
        step = "identify the soil from the rows: soilml identify, or soilml gap"
    basis = "each row of the table is a steady run"
    if found.series:
        basis = f"{_kept_share(found)} of the time is in steady windows"
    return Report(
        kind="import",
        verdict=verdict,
        tables=[*_tables(found)],
        pictures=[*_pictures(found)],
        remarks=odd[1:],
        next_steps=[step],
        details=[("[bias] for the model file", [found.bias_toml()])],
        status=f"{rows} row{'s'[: rows != 1]}",
        tone=tone,
        title=f"Import report: {found.map_name}",
        basis=f"{runs} run{'s'[: runs != 1]}; {basis}",
        notation=[("+-", "one standard deviation, of what is independent from row to row.")],
    )


def _tables(found: ImportedLog) -> Iterator[ReportTable]:
    table = found.table
    names = [n for n in _SHOWN if n in table]
    columns = {n: table[n] for own in names for n in (own, f"{own}_std") if n in table}
    about = "Means of the steady windows; +- knows the autocorrelation."
    yield ReportTable.of("Rows", columns, about)
    seconds: dict[tuple[str, Remark | None], list[tuple[float, float]]] = {}
    for run, s in found.left_out():
        seconds.setdefault((run, s.why), []).append((s.start, s.stop))
    if seconds:
        entries = sorted(seconds.items(), key=lambda e: -sum(b - a for a, b in e[1]))
        spans = [", ".join(f"{a:.1f} to {b:.1f}" for a, b in own[:4]) for _, own in entries]
        yield ReportTable(
            "Left out",
            [
                Column("run", [run for (run, _), _ in entries]),
                Column("seconds", [sum(b - a for a, b in own) for _, own in entries], digits=3),
                Column("where, s", spans),
                Column("why", [str(why) for (_, why), _ in entries]),
            ],
        )


def _pictures(found: ImportedLog) -> Iterator[Picture]:
    yield rows_over_slip(found.table)
    for series in found.series[:MOST_RUNS]:
        panels = len(run_panels(series))
        notes = "; ".join(note.text for note in series.notes)
        yield Picture(
            f"Run {series.run}",
            partial(draw_run, series, found.table),
            panels,
            1,
            (6.4, 1.05 * panels + 0.6),
            f"run {series.run}: {sum(not s.why for s in series.stretches)} steady windows",
            f"Blue: steady windows, each of which became a row; marks: means with 90 % intervals. "
            f"Grey: left out. {notes}".rstrip(),
        )


def _kept_share(found: ImportedLog) -> str:
    total = sum(float(s.time[-1] - s.time[0]) for s in found.series)
    kept = sum(w.stop - w.start for s in found.series for w in s.stretches if not w.why)
    return format_quantity(kept / total if total else 0.0, "share", digits=2)


def rows_over_slip(table: Table) -> Picture:
    """The rows over slip: a panel for each channel that was measured, in a colour for each load."""
    shown = [[n] for n in _SHOWN[4:] if n in table and np.isfinite(table[n]).any()]
    levels, loads = load_levels(table["load_N"]).index, table["load_N"]
    usual = np.asarray([np.median(loads[levels == k]) for k in range(int(levels.max()) + 1)])
    caption = "Bars are standard errors of each row, from its scatter. Errors that all rows share "
    return column_picture(
        table.columns | {"load_N": usual[levels]}, "slip", shown or [["torque_Nm"]], ["load_N"],
        title="The rows over slip", caption=f"{caption}come in addition.", points=True,
    )  # fmt: skip


def _std(table: Table, key: str) -> Floats:
    """Standard errors of a column (rows,), 0 where they are not known."""
    known = f"{key}_std" in table
    return np.nan_to_num(table[f"{key}_std"]) if known else np.zeros(len(table))


def run_panels(series: WheelSeries) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """The panels of the picture of a run."""
    return [panel for panel in _PANELS if any(_finite(series, name) for name in panel[1])]


def draw_run(series: WheelSeries, table: Table, panels: Any) -> None:
    """Draw the channels of a run over time into axes, one for each of `run_panels`."""
    rows = table.rows(table["run"] == series.run)
    for axes, (title, names, labels) in zip(np.ravel(panels), run_panels(series), strict=True):
        for s in series.stretches:
            colour = _LEFT_OUT if s.why else _WINDOW  # windows that touch are told apart
            axes.axvspan(s.start, s.stop, facecolor=colour, alpha=0.35, lw=0, zorder=0)
        scale = 1e3 if title.endswith("mm") else 1.0
        ends: list[Any] = [0.0]
        for name, label, colour in zip(names, labels, _LINES, strict=False):
            if not _finite(series, name):
                continue
            values = scale * series.quantities[name]
            if name == "slip":
                values = np.where(_turning(series), values, np.nan)
            if np.isfinite(values).any():
                ends += [*np.nanpercentile(values, [0.5, 99.5])]
            axes.plot(*_thinned(series.time, values), color=colour, lw=0.7, alpha=0.65)
            if label:
                axes.plot([], [], color=colour, label=label)
            ends += _draw_means(axes, rows, name, scale)
        # by percentiles, so that a single spike does not flatten the rest; all means are in
        margin = 0.08 * (max(ends) - min(ends)) or 1.0
        axes.set_ylim(min(ends) - margin, max(ends) + margin)
        axes.set_title(title, fontsize=9.5, pad=3)
        axes.grid(visible=False)
        axes.tick_params(labelsize=8.5)
        axes.set_xlim(series.time[0], series.time[-1])
        axes.locator_params(axis="y", nbins=4)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="lower right", ncols=2)
    axes.set_xlabel("time, s", fontsize=9.5)


def _draw_means(axes: Axes, rows: Table, name: str, scale: float) -> list[float]:
    """Draw the values of the rows with their 90 % intervals; returns those that are known."""
    key = _COLUMNS.get(name, "")
    if key not in rows or not len(rows):
        return []
    axes.errorbar(
        rows["time_s"], scale * rows[key], Z_90 * scale * _std(rows, key), fmt="o", ms=3.2,
        color="black", ecolor="black", elinewidth=1.2, capsize=2, zorder=4,
    )  # fmt: skip
    return [*(scale * rows[key][np.isfinite(rows[key])])]


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
    with catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # parts without a number
        ends = np.stack([np.nanmin(blocks, axis=1), np.nanmax(blocks, axis=1)], axis=1)
    return time[: count * width].reshape(count, width)[:, [0, width // 2]].ravel(), ends.ravel()
