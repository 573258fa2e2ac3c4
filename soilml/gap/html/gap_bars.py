"""Section "Size of the gap": bar charts of the mean squared residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from soilml.gap.gap_figure import TITLES, Bar, draw_bars
from soilml.gap.report_parts import GapReduction
from soilml.gap.results import GapReport
from soilml.report.figure_style import SvgImage, new_figure, report_style, svg_image
from soilml.report.numbers import channel_name, format_residual


@dataclass(frozen=True)
class GapBars:
    """A chart with its title and the figures that it shows."""

    title: str
    reduction: GapReduction
    image: str
    alt: str


def gap_bars(report: GapReport, changed: bool) -> list[GapBars]:
    """One chart for the fitted rows and one for each held-out part, on a common axis."""
    tables = {}
    for key, reduction in report.gap.items():
        pairs = {"all readings": (reduction.before, reduction.after)}
        pairs |= {channel_name(k): v for k, v in reduction.channels.items()}
        tables[key] = pairs
    values = [v for pairs in tables.values() for pair in pairs.values() for v in pair]
    values = [v for v in values if math.isfinite(v)] or [1.0]
    charts = []
    for key, pairs in tables.items():
        rows = [Bar(k, b, a if changed else math.nan) for k, (b, a) in pairs.items()]
        title = TITLES.get(key, key.replace("_", " "))
        chart = _bar_chart(rows, max(values), min(values), f"{title}: {_as_text(rows)}")
        charts.append(GapBars(title, report.gap[key], chart.image, chart.alt))
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
