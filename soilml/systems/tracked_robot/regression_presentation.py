"""Regressions of measured on predicted values as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from soilml.quantities import COLUMNS
from soilml.report.figure_style import AFTER, BEFORE, UNCHANGED
from soilml.report.numbers import channel_name, channel_unit, pretty, rounded, with_unit
from soilml.report.report import Picture
from soilml.report.tables import Column, ReportTable
from soilml.systems.tracked_robot.group_identification import ChannelRegression

SIDE = 4.2  # Width and height of a panel, inches


def regression_lines(found: Mapping[str, ChannelRegression], source: str) -> list[str]:
    """A line for each channel: how measured values follow predicted ones."""
    return [
        f"{channel_name(key)}, {one.line.points} rows of {source} on predictions by the mean: "
        f"slope {rounded(one.line.slope, one.line.slope_std)} +- "
        f"{rounded(one.line.slope_std, one.line.slope_std)}, r2 {one.line.r2:.3f}"
        for key, one in found.items()
    ]


def regression_table(found: Mapping[str, ChannelRegression], source: str) -> ReportTable:
    """A row for each channel: the line of measured on predicted values."""
    lines = [one.line for one in found.values()]
    return ReportTable(
        f"Measured on predicted, rows of {source}",
        [
            Column("channel", [channel_name(key) for key in found]),
            Column("slope", [line.slope for line in lines], std=[line.slope_std for line in lines]),
            Column(
                "intercept", [line.intercept for line in lines], [COLUMNS[k].unit for k in found]
            ),
            Column("r2", [line.r2 for line in lines], digits=3),
            Column("F", [line.f for line in lines], digits=3),
            Column("points", [line.points for line in lines]),
        ],
        "A high r2 shows correlation. Agreement needs a line of slope 1 through the origin.",
    )


def regression_picture(found: Mapping[str, ChannelRegression], source: str) -> Picture:
    """Measured against predicted values, a panel for each channel."""
    return Picture(
        f"Rows of {source}, which no group has, against predictions by the mean",
        partial(_plot, found),
        1,
        len(found),
        (SIDE * len(found), SIDE),
        f"measured against predicted {', '.join(map(channel_name, found))}, with regression lines",
    )


def _plot(found: Mapping[str, ChannelRegression], axes: Any) -> None:
    for panel, (key, one) in zip(axes.flat, found.items(), strict=True):
        factor, unit = channel_unit(key)
        x, y = factor * one.predicted, factor * one.measured
        both = np.concatenate([x, y])
        ends = 1.05 * np.asarray([min(both.min(), 0.0), max(both.max(), 0.0)])
        panel.plot(ends, ends, color=UNCHANGED, lw=1, label="agreement")
        panel.plot(x, y, "o", color=AFTER, ms=5, label="rows")
        panel.plot(
            ends, factor * one.line.intercept + one.line.slope * ends, color=BEFORE, label="line"
        )
        name = channel_name(key)
        panel.set(xlim=ends, ylim=ends, aspect="equal")
        panel.set_xlabel(pretty(with_unit(f"{name} predicted", unit)))
        panel.set_ylabel(pretty(with_unit(f"{name} measured", unit)))
        panel.legend(loc="upper left")
