"""Picture of the designs: probability, margin, front, and what the margin depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.report.figure_style import AFTER, BEFORE, UNCHANGED, take_axes
from soilml.report.numbers import pretty, shown_unit, with_unit
from soilml.rover_design.search import RESULTS, Designs
from soilml.rover_design.study import DIMENSIONS

if TYPE_CHECKING:
    from soilml.rover_design.report import DesignReport

SIZE = (10.0, 7.0)  # Width and height of the figure, inches
LEVELS = 10  # Levels of the contours
#: Units of results that a goal may ask to be least.
UNITS = {"energy": "work of the wheels, J/m", "torque": "torque of a wheel, N m"}


def plot_designs(report: DesignReport, ax: Any = None) -> NDArray[Any]:
    """Draw four panels: probability, margin at the risk, front, shares of the variance.

    The first two are contours over the first two dimensions that vary, with the others as the best
    design has them, or curves where one varies.

    ax: Four axes of matplotlib; a new figure where None. Returns the axes, (2, 2). Raises
        `InputError` for another number of axes.
    """
    panels = take_axes(ax, 2, 2, SIZE)
    goal, varied = report.study.goal, report.study.varied
    titles = ("probability of meeting the goal", f"margin at a risk of {goal.risk:g}, N")
    if report.contours is not None:
        _contours(panels[0, 0], report, report.contours, "probability", titles[0])
        _contours(panels[0, 1], report, report.contours, "margin_at_risk_N", titles[1])
    elif varied:
        _curve(panels[0, 0], report, "probability", titles[0])
        _curve(panels[0, 1], report, "margin_at_risk_N", titles[1])
    else:
        for panel, title in zip(panels[0], titles, strict=True):
            panel.text(0.5, 0.5, "one design", ha="center", transform=panel.transAxes)
            panel.set_title(title)
    _front(panels[1, 0], report)
    _shares(panels[1, 1], report)
    return panels


def axis_label(name: str) -> str:
    """A dimension with its unit in a figure or table."""
    return pretty(with_unit(name.replace("_", " "), shown_unit(DIMENSIONS[name].unit)[1]))


def shown(name: str, values: Floats) -> Floats:
    """Values of a dimension in the unit of a figure."""
    return np.asarray(shown_unit(DIMENSIONS[name].unit)[0] * np.asarray(values))


def _contours(panel: Any, report: DesignReport, grid: Designs, key: str, title: str) -> None:
    names = report.study.varied[:2]
    x, y = (shown(name, grid.dimensions[name]) for name in names)
    values = np.where(np.isfinite(grid.results[key]), grid.results[key], np.nan)
    known = np.isfinite(values)
    enough = len(np.unique(x[known])) > 1 and len(np.unique(y[known])) > 1
    if enough and np.ptp(values[known]) > 0.0:
        filled = panel.tricontourf(x[known], y[known], values[known], LEVELS, cmap="cividis")
        panel.figure.colorbar(filled, ax=panel)
        wanted = 1.0 - report.study.goal.risk if key == "probability" else report.study.goal.margin
        if values[known].min() < wanted < values[known].max():
            panel.tricontour(x[known], y[known], values[known], [wanted], colors="white")
    best = [float(shown(name, np.asarray(report.best_dimensions[name]))) for name in names]
    panel.plot(*best, "o", color="white", mec="black", ms=8, clip_on=False)
    panel.set_xlabel(axis_label(names[0]))
    panel.set_ylabel(axis_label(names[1]))
    panel.set_title(title)


def _curve(panel: Any, report: DesignReport, key: str, title: str) -> None:
    (name,) = report.study.varied
    designs = report.designs
    order = np.argsort(designs.dimensions[name])
    x = shown(name, designs.dimensions[name])[order]
    panel.plot(x, designs.results[key][order], "-", color=AFTER)
    if key != "probability":
        low, high = (designs.results[f"margin_N{end}"][order] for end in ("_p05", "_p95"))
        panel.fill_between(x, low, high, color=AFTER, alpha=0.2, lw=0)
        panel.axhline(0.0, color=UNCHANGED, lw=0.8)
    best = float(shown(name, np.asarray(report.best_dimensions[name])))
    panel.axvline(best, color=BEFORE, lw=1.0)
    panel.set_xlabel(axis_label(name))
    panel.set_title(title)


def _front(panel: Any, report: DesignReport) -> None:
    least, designs = report.study.goal.least, report.designs
    factor = shown_unit(DIMENSIONS[least].unit)[0] if least in DIMENSIONS else 1.0
    x, y = factor * designs.least_of(least), designs.results["margin_at_risk_N"]
    known = np.isfinite(x) & np.isfinite(y)
    panel.plot(x[known], y[known], ".", color="#bbbbbb", ms=4, label="designs")
    panel.plot(x[report.front], y[report.front], "o-", color=AFTER, ms=4, label="front")
    best = report.best_dimensions.get(least, report.best.get(RESULTS.get(least, ""), np.nan))
    margin = report.best["margin_at_risk_N"]
    if np.isfinite(margin):
        panel.plot(factor * best, margin, "o", color=BEFORE, ms=8, label="best")
    panel.axhline(report.study.goal.margin, color=UNCHANGED, lw=0.8)
    panel.set_xlabel(UNITS[least] if least in UNITS else axis_label(least))
    panel.set_ylabel(f"margin at a risk of {report.study.goal.risk:g}, N")
    panel.set_title(f"front: margin against {least.replace('_', ' ')}")
    panel.legend(frameon=False, fontsize=9)


def _shares(panel: Any, report: DesignReport) -> None:
    shares = report.shares[:8][::-1]
    panel.barh(range(len(shares)), [100.0 * one.share for one in shares], 0.35, color=AFTER)
    for number, one in enumerate(shares):
        panel.text(0.0, number + 0.22, one.text, fontsize=9)
    panel.set_yticks([])
    panel.set_ylim(-0.4, len(shares) - 0.2)
    panel.set_xlabel("share of the margin's variance, %")
    panel.set_title("origin of the margin's spread")
