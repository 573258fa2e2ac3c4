"""Regressions of measured on predicted values as text, as a picture and in JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from soilml.quantities import COLUMNS
from soilml.report.figure_style import AFTER, BEFORE, UNCHANGED, picture, take_axes
from soilml.report.numbers import capitalised, channel_name, channel_unit
from soilml.report.page import ReportPicture
from soilml.systems.tracked_robot.group_identification import ChannelRegression

SIDE = 4.2  # Width and height of a panel, inches


def regression_text(found: Mapping[str, ChannelRegression], source: str) -> str:
    """A line for each channel."""
    return "\n".join(_sentence(key, one, source) for key, one in found.items())


def regressions_as_json(found: Mapping[str, ChannelRegression]) -> dict[str, Any]:
    """The line of each channel by column; the intercept in the unit of the column."""
    return {key: asdict(one.line) for key, one in found.items()}


def regression_picture(found: Mapping[str, ChannelRegression], source: str) -> ReportPicture:
    """Measured against predicted values, a panel for each channel."""

    def draw(ax: Any) -> None:
        plot_regressions(found, ax)

    image = picture(draw, 1, len(found), (SIDE * len(found), SIDE), regression_text(found, source))
    return ReportPicture(
        f"Rows of {source}, which no group has, against predictions by the mean",
        image,
        "A high r2 shows correlation. Agreement needs a line of slope 1 through the origin.",
    )


def plot_regressions(found: Mapping[str, ChannelRegression], ax: Any = None) -> Any:
    """Draw measured against predicted values; axes (channels,), `ax` takes as many."""
    axes = take_axes(ax, 1, len(found), (SIDE * len(found), SIDE))[0]
    for panel, (key, one) in zip(axes, found.items(), strict=True):
        factor, unit = channel_unit(key)
        x, y = factor * one.predicted, factor * one.measured
        both = np.concatenate([x, y])
        ends = 1.05 * np.asarray([min(both.min(), 0.0), max(both.max(), 0.0)])
        panel.plot(ends, ends, color=UNCHANGED, lw=1, label="agreement")
        panel.plot(x, y, "o", color=AFTER, ms=5, label="rows")
        fitted = factor * one.line.intercept + one.line.slope * ends
        panel.plot(ends, fitted, color=BEFORE, label="line")
        name = channel_name(key)
        panel.set(xlim=ends, ylim=ends, xlabel=f"{name} predicted, {unit}", aspect="equal")
        panel.set_ylabel(f"{name} measured, {unit}")
        panel.set_title(f"slope {_with_std(one)}, r2 {one.line.r2:.3f}", fontsize=10)
        panel.legend(fontsize=9, frameon=False, loc="upper left")
    return axes


def _with_std(one: ChannelRegression) -> str:
    return f"{one.line.slope:.3f} +- {one.line.slope_std:.3f}"


def _sentence(key: str, one: ChannelRegression, source: str) -> str:
    line = one.line
    return (
        f"{capitalised(channel_name(key))} measured on predicted, {line.points} rows of {source}: "
        f"slope {_with_std(one)}, intercept {line.intercept:.3g} {COLUMNS[key].unit}, "
        f"r2 {line.r2:.3f}, F {line.f:.1f}"
    )
