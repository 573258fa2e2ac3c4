"""What the answer to a question of a design says: designs, soils, origin of the spread."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.arrays import Floats
from soilml.report.figure_style import AFTER, BEFORE, UNCHANGED
from soilml.report.numbers import (
    format_band,
    format_quantity,
    pretty,
    shown_unit,
    significant,
    with_unit,
)
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.rover_design.search import QUANTILES, RESULTS
from soilml.rover_design.study import DIMENSIONS

if TYPE_CHECKING:
    from soilml.rover_design.report import DesignReport

FEWEST = 0.5  # Share of worlds that climb below which nothing is said of slip and work there
MOST_ROWS = 10  # Most designs of the front in a table
#: Results in the table of designs: column, heading, unit.
_COLUMNS = (
    ("probability", "goal met", "share"),
    ("margin_N", "margin", "N"),
    ("margin_at_risk_N", "margin at risk", "N"),
    ("energy_J_per_m", "work", "J/m"),
    ("slip", "slip", "1"),
    ("torque_Nm", "torque", "N m"),
)
#: Results that hold where the slope is climbed.
_WHERE_CLIMBED = ("slip", "energy_J_per_m", "torque_Nm")


def report_of_design(found: DesignReport, title: str) -> Report:
    """The report of the answer to a question of a design."""
    goal = found.study.goal
    return Report(
        kind="design",
        verdict=_verdict(found),
        tables=[_designs(found), *_tables(found)],
        pictures=[
            Picture(
                "Designs", partial(_draw_designs, found), 1, 3, SIZE, _verdict(found),
                "Points: the designs that were tried. Large point: the best one.",
            )
        ],
        remarks=found.remarks,
        next_steps=[
            f"{one.text}: it leaves {format_quantity(one.left, 'share', digits=2)} of the spread "
            f"at best ({one.command})"
            for one in found.tests[:3]
        ],
        status="meets the goal" if found.met else "does not meet the goal",
        tone="good" if found.met else "bad",
        title=title,
        basis=f"risk {format_quantity(goal.risk, 'share')}, gravity "
        f"{found.study.gravity:.4g} m/s^2",
        notation=[
            ("margin", "largest pull up to the slip limit less the weight along the slope."),
            ("margin at risk", "exceeded with the probability that the risk leaves."),
            ("share", "of the variance of the margin, by one input alone."),
        ],
    )  # fmt: skip


def _verdict(found: DesignReport) -> str:
    """What the best design is, with what probability and margin it climbs."""
    goal, best = found.study.goal, found.best
    sizes = ", ".join(
        f"{name.replace('_', ' ')} "
        f"{format_quantity(found.best_dimensions[name], DIMENSIONS[name].unit)}"
        for name in _named(found)
    )
    margin = format_band(best["margin_N_p05"], best["margin_N"], best["margin_N_p95"], "N")
    near = abs(best["probability"] - 1.0 + goal.risk) < 0.01
    chance = format_quantity(best["probability"], "share", digits=3 if near else 2)
    slope = f"{significant(math.degrees(goal.slope), 3)} deg"
    if goal.margin > 0.0 or min(goal.torque_limit, goal.energy_limit) < math.inf:
        slope += " within its limits"
    begin = "" if found.met else "No design is sure enough; likeliest: "
    return f"{begin}{sizes} climbs {slope} with {chance}, margin {margin}."


def _named(found: DesignReport) -> list[str]:
    return found.study.varied or ["radius", "width", "lug_height"]


def _designs(found: DesignReport) -> ReportTable:
    """The best design, and some of the front, each with its dimensions and results.

    What is to be least stands behind the probability. The margin at a risk of 5 % is the lower end
    of its band.
    """
    goal, designs = found.study.goal, found.designs
    numbers, smallest = found.front, designs.least_of(goal.least)[found.front]
    if len(numbers) > MOST_ROWS:  # those nearest to steps of what is to be least
        steps = np.linspace(smallest[0], smallest[-1], MOST_ROWS)[:, None]
        numbers = numbers[np.unique(np.abs(smallest - steps).argmin(axis=1))]

    def values(key: str) -> Floats:
        best = found.best_dimensions | found.best
        return np.concatenate([[best[key]], np.asarray(designs.columns[key], float)[numbers]])

    least = RESULTS.get(goal.least, "probability")
    first = ("probability", least)
    columns = sorted(_COLUMNS, key=lambda c: first.index(c[0]) if c[0] in first else len(first))
    climbed = values("probability_climbed") >= FEWEST
    shown = [Column("design", ["best", *["front"] * len(numbers)])]
    for name in _named(found):
        unit = DIMENSIONS[name].unit
        shown.append(Column(name.replace("_", " "), values(name).tolist(), unit, digits=3))
    for key, heading, unit in columns:
        if key == "margin_at_risk_N" and goal.risk == QUANTILES["_p05"]:
            continue
        cells = values(key)
        if key in _WHERE_CLIMBED:
            cells = np.where(climbed, cells, np.nan)
        ends = None
        if key == "margin_N":
            ends = (values("margin_N_p05").tolist(), values("margin_N_p95").tolist())
        shown.append(Column(heading, cells.tolist(), unit, ends=ends, digits=3))
    return ReportTable("Designs", shown)


def _tables(found: DesignReport) -> Iterator[ReportTable]:
    if found.by_soil:
        met, middle, low, high = (
            [one[name] for one in found.by_soil.values()]
            for name in ("probability", "margin_N", "margin_N_p05", "margin_N_p95")
        )
        yield ReportTable(
            "The best design on each soil",
            [
                Column("soil", list(found.by_soil)),
                Column("goal met", met, "share", digits=3),
                Column("margin", middle, "N", ends=(low, high)),
            ],
        )
    if found.shares:
        shares = [one.share for one in found.shares]
        texts = [one.text for one in found.shares]
        columns = [Column("input", texts), Column("share", shares, "share", digits=2)]
        yield ReportTable("What the margin depends on", columns)
    if found.tests:
        tests = found.tests
        yield ReportTable(
            "Tests that would reduce the spread",
            [
                Column("test", [one.text for one in tests]),
                Column("removes", [one.share for one in tests], "share", digits=2),
                Column("leaves", [one.left for one in tests], "share", digits=2),
                Column("read by", [one.command for one in tests]),
            ],
            "At most, of the variance of the margin and of its standard deviation.",
        )


SIZE = (13.5, 4.0)  # Width and height of the figure, inches
#: Units of results that a goal may ask to be least.
UNITS = {"energy": "work of the wheels, J/m", "torque": "torque of a wheel, N m"}


def _draw_designs(report: DesignReport, axes: Any) -> None:
    """Draw probability and margin at the risk of all designs, and the front, into three panels."""
    panels = np.ravel(axes)
    titles = (
        "probability of meeting the goal",
        f"margin at a risk of {report.study.goal.risk:g}, N",
    )
    for panel, key, title in zip(panels, ("probability", "margin_at_risk_N"), titles, strict=False):
        _by_size(panel, report, key)
        panel.set_title(title)
    _front(panels[2], report)


def axis_label(name: str) -> str:
    """A dimension with its unit in a figure or table."""
    return pretty(with_unit(name.replace("_", " "), shown_unit(DIMENSIONS[name].unit)[1]))


def shown(name: str, values: Floats) -> Floats:
    """Values of a dimension in the unit of a figure."""
    return np.asarray(shown_unit(DIMENSIONS[name].unit)[0] * np.asarray(values))


def _by_size(panel: Any, report: DesignReport, key: str) -> None:
    """A result of all designs: by colour over two dimensions, or over the first one."""
    names, designs = report.study.varied[:2] or ["radius"], report.designs
    places = [shown(name, designs.dimensions[name]) for name in names]
    best = [float(shown(name, np.asarray(report.best_dimensions[name]))) for name in names]
    panel.set_xlabel(axis_label(names[0]))
    if len(names) == 2:
        points = panel.scatter(*places, c=designs.results[key], s=18, cmap="cividis")
        panel.figure.colorbar(points, ax=panel)
        panel.plot(*best, "o", color="white", mec="black", ms=9, clip_on=False)
        panel.set_ylabel(axis_label(names[1]))
        return
    order = np.argsort(places[0])
    panel.plot(places[0][order], designs.results[key][order], ".-", color=AFTER)
    panel.axvline(best[0], color=BEFORE, lw=1.0)


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
