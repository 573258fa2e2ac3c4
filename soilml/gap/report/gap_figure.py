"""The gap before and after as bars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from soilml.errors import InputError
from soilml.gap.report.results import BeforeAfter, GapReduction, GapReport
from soilml.report.figure_style import (
    AFTER,
    BEFORE,
    UNCHANGED,
    SvgImage,
    new_figure,
    report_style,
    svg_image,
    take_axes,
)
from soilml.report.numbers import channel_name, format_number, format_residual

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Titles of the charts, by the names of the figures in gap.json.
TITLES = {
    "train": "Fitted rows",
    "held_out_runs": "Held-out runs",
    "held_out_region": "Held-out region",
    "held_out_slips": "Held-out slips",
}


@dataclass(frozen=True)
class Bar:
    """A row of a bar chart; `after` is NaN where the figures did not change."""

    label: str
    before: float
    after: float


def draw_bars(axes: Axes, rows: Sequence[Bar], most: float, least: float) -> None:
    """Draw gaps before and after on a logarithmic axis; bars start at 1, which is noise alone.

    `most` and `least` are the values that the axis spans.
    """
    high = 10.0 ** (1.45 * math.log10(max(most, 4.0)) + 0.2)
    low = min(0.5, 0.7 * max(least, 1e-3))
    for i, row in enumerate(rows):
        pair = [(row.before, BEFORE), (row.after, AFTER)]
        if math.isnan(row.after):
            pair = [(row.before, UNCHANGED)]
        for k, (value, colour) in enumerate(pair):
            y = i + (0.0 if len(pair) == 1 else 0.36 * k - 0.18)
            end = min(max(value, low), high) if math.isfinite(value) else 1.0
            axes.barh(y, end - 1.0, 0.3, left=1.0, color=colour)
            axes.plot([end], [y], "|", color=colour, ms=14, mew=2, clip_on=False)
            text = format_residual(value) if math.isfinite(value) else "not finite"
            axes.annotate(
                text, (max(end, 1.0), y), xytext=(7, 0), textcoords="offset points",
                va="center", ha="left", annotation_clip=False,
                fontweight="bold" if row.label == rows[0].label else "normal",
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.axvline(1.0, color="black", lw=1.2)
    axes.set_yticks(range(len(rows)), [row.label for row in rows])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    decades = range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
    step = max(1, math.ceil(len(decades) / 5))
    ticks = [10.0**d for d in decades if d % step == 0]
    axes.set_xticks(ticks, [format_number(t, 1) for t in ticks])
    axes.minorticks_off()
    axes.set_xlabel("mean squared residual; line at 1: noise alone", fontsize=10.5)


def plot_gap(gap: Mapping[str, GapReduction], ax: Any = None, part: str = "train") -> Axes:
    """Draw the mean squared residuals of one part of the rows, before and after."""
    if part not in gap:
        known = ", ".join(gap) or "none: it could not be analysed"
        raise InputError(f"part is {part!r}; this report has {known}")
    rows = _bars(gap[part], gap[part].shrinks)
    axes: Axes = take_axes(ax, 1, 1, (5.4, 0.9 + 0.6 * len(rows)))[0, 0]
    draw_bars(axes, rows, *_range(gap[part]))
    axes.set_title(TITLES.get(part, part.replace("_", " ")))
    return axes


def _bars(figures: GapReduction, changed: bool) -> list[Bar]:
    """The rows of a chart: all readings, then each channel."""
    pairs = {"all readings": BeforeAfter(figures.before, figures.after)}
    pairs |= {channel_name(name): pair for name, pair in figures.channels.items()}
    return [Bar(name, b, a if changed else math.nan) for name, (b, a) in pairs.items()]


def _range(*reductions: GapReduction) -> tuple[float, float]:
    """The largest and the smallest finite figure of some reductions."""
    pairs = [pair for r in reductions for pair in ((r.before, r.after), *r.channels.values())]
    values = [v for pair in pairs for v in pair if math.isfinite(v)] or [1.0]
    return max(values), min(values)


@dataclass(frozen=True)
class GapBars:
    """A chart with its title and the figures that it shows."""

    title: str
    reduction: GapReduction
    image: SvgImage


def gap_bars(report: GapReport, changed: bool) -> list[GapBars]:
    """One chart for the fitted rows and one for each held-out part, on a common axis."""
    most, least = _range(*report.gap.values())
    charts = []
    for key, reduction in report.gap.items():
        rows = _bars(reduction, changed and reduction.shrinks)
        title = TITLES.get(key, key.replace("_", " "))
        chart = _bar_chart(rows, most, least, f"{title}: {_as_text(rows)}")
        charts.append(GapBars(title, reduction, chart))
    return charts


def _bar_chart(rows: Sequence[Bar], most: float, least: float, alt: str) -> SvgImage:
    """The chart as an image."""
    with report_style():
        canvas = new_figure(30 + 46 * len(rows) + 24)
        height = 54 + 46 * len(rows)
        axes = canvas.add_axes((0.27, 48 / height, 0.71, 1 - 56 / height))
        draw_bars(axes, rows, most, least)
        return svg_image(canvas, alt)


def _as_text(rows: Sequence[Bar]) -> str:
    """The rows of a chart as its text alternative."""
    parts = []
    for row in rows:
        after = "" if math.isnan(row.after) else f" before, {format_residual(row.after)} after"
        parts.append(f"{row.label} {format_residual(row.before)}{after}")
    return "; ".join(parts)
