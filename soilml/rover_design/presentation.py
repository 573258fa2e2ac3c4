"""The answer to a question of a design as text and as a page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from soilml.io.text_tables import WIDTH, format_table
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture, ReportTable
from soilml.report.terminal import shown_unit, significant
from soilml.rover_design.figures import SIZE, axis_label
from soilml.rover_design.report import DesignReport, SoilOutcome, number
from soilml.rover_design.search import QUANTILES, RESULTS
from soilml.rover_design.study import DIMENSIONS

FEWEST = 0.5  # Share of worlds that climb below which nothing is said of slip and work there
MOST_ROWS = 10  # Most designs of the front in a table
#: Results in the table of designs: column, heading on a terminal and on a page, factor.
_COLUMNS = (
    ("probability", "goal_%", "goal met, %", 100.0),
    ("margin_N", "margin_N", "margin, N", 1.0),
    ("margin_N_p05", "p05", "5 %", 1.0),
    ("margin_N_p95", "p95", "95 %", 1.0),
    ("margin_at_risk_N", "at_risk_N", "margin at risk, N", 1.0),
    ("energy_J_per_m", "work_J/m", "work, J/m", 1.0),
    ("slip", "slip", "slip", 1.0),
    ("torque_Nm", "torque_Nm", "torque, N m", 1.0),
    ("lugs_needed", "lugs_min", "lugs needed", 1.0),
)
#: Short headings of dimensions on a terminal.
_HEADS = {
    "radius": "radius_mm",
    "width": "width_mm",
    "lug_height": "lug_mm",
    "lug_count": "lugs",
    "wheels": "wheels",
    "mass": "mass_kg",
}
#: Results that hold where the slope is climbed.
_WHERE_CLIMBED = ("slip", "energy_J_per_m", "torque_Nm", "lugs_needed")


def design_text(report: DesignReport) -> str:
    """The verdict in one line, tables of designs, of uncertainties and tests, and remarks."""
    parts = [report.summary(), _designs_table(report)]
    if report.by_soil:
        cells = [(one.name, *_soil_cells(one)) for one in report.by_soil]
        parts.append(format_table(("best on", "goal_%", "margin_N", "p05", "p95"), cells))
    if report.shares:
        lines = [(one.text, f"{100.0 * one.share:.0f}") for one in report.shares]
        parts.append(format_table(("the margin depends on", "%"), lines))
    if report.tests:
        tests = [
            (one.text, f"{100.0 * one.share:.0f}", f"{100.0 * one.left:.0f}", one.command)
            for one in report.tests
        ]
        header = ("test", "removes_%", "leaves_%", "read by")
        parts.append(format_table(header, tests, last_left=True))
    parts.append("\n".join(f"! {remark}" for remark in report.remarks))
    return "\n\n".join(parts)


def _designs_table(report: DesignReport) -> str:
    """The table of designs; last columns that do not fit on a line are left out, and named."""
    header = [
        "",
        *(_HEADS[name] for name in _named(report)),
        *(title for _, title, _, _ in _columns(report)),
    ]
    rows = [list(row) for row in _rows(report)]
    widths = [max(len(row[i]) for row in [header, *rows]) + 2 for i in range(len(header))]
    shown = len(header)
    while sum(widths[:shown]) - 2 > WIDTH:
        shown -= 1
    table = format_table(header[:shown], [row[:shown] for row in rows], text_columns=1)
    if shown == len(header):
        return table
    return f"{table}\nnot shown here, but with --out: {', '.join(header[shown:])}"


def _named(report: DesignReport) -> list[str]:
    return report.study.varied or ["radius", "width", "lug_height"]


def _columns(report: DesignReport) -> list[tuple[str, str, str, float]]:
    """Columns of the table of designs, with what is to be least behind the probability.

    The margin at a risk of 5 % is the lower end of its band.
    """
    goal = report.study.goal
    same = goal.risk == QUANTILES["_p05"]
    kept = [c for c in _COLUMNS if not (same and c[0] == "margin_at_risk_N")]
    least = "lugs_needed" if goal.least == "lug_count" else RESULTS.get(goal.least, "probability")
    first = ("probability", least)
    return sorted(kept, key=lambda c: first.index(c[0]) if c[0] in first else len(first))


def _soil_cells(one: SoilOutcome) -> list[str]:
    low, middle, high = one.margin
    return [f"{100.0 * one.probability:.0f}", *(number(value) for value in (middle, low, high))]


def _rows(report: DesignReport) -> Iterator[Sequence[str]]:
    """The best design, and some of the front, each with its dimensions and results."""
    best = {**report.best_dimensions, **report.best}
    yield ("best", *_cells(report, best))
    designs = report.designs
    index = np.linspace(0, len(report.front) - 1, min(len(report.front), MOST_ROWS)).round()
    for i in np.unique(index).astype(int):
        number = report.front[i]
        columns = {**designs.dimensions, **designs.results}
        yield ("front", *_cells(report, {k: float(v[number]) for k, v in columns.items()}))


def _cells(report: DesignReport, values: dict[str, float]) -> Iterator[str]:
    for name in _named(report):
        yield significant(shown_unit(DIMENSIONS[name].unit)[0] * values[name], 3)
    for key, _, _, factor in _columns(report):
        value = factor * values[key]
        if key in _WHERE_CLIMBED and values["probability_climbed"] < FEWEST:
            value = math.nan
        if math.isinf(value):
            yield "sinks"
        elif not math.isfinite(value):
            yield ""
        elif key in ("probability", "lugs_needed"):
            yield f"{value:.0f}"
        else:
            yield f"{value:.2f}" if key in (RESULTS["slip"], RESULTS["torque"]) else f"{value:.1f}"


def design_page(report: DesignReport, file: str) -> Report:
    """The page of a question of a design, read from `file`."""
    goal = report.study.goal
    rows = [[cell.replace("-", "−") for cell in row] for row in _rows(report)]
    head = [*map(axis_label, _named(report)), *(title for _, _, title, _ in _columns(report))]
    tables = [ReportTable("designs", ["", *head], rows)]
    if report.by_soil:
        soils = [[o.name, *(c.replace("-", "−") for c in _soil_cells(o))] for o in report.by_soil]
        header = ["soil", "goal met, %", "margin, N", "5 %", "95 %"]
        tables.append(ReportTable("the best design on each soil", header, soils))
    if report.shares:
        shares = [[one.text, f"{100.0 * one.share:.0f}"] for one in report.shares]
        tables.append(ReportTable("what the margin depends on", ["input", "share, %"], shares))
    if report.tests:
        tests = [
            [one.text, f"{100.0 * one.share:.0f}", f"{100.0 * one.left:.0f}"]
            for one in report.tests
        ]
        title = "tests that would reduce the spread, at most by"
        header = ["test", "of the variance, %", "standard deviation left, %"]
        tables.append(ReportTable(title, header, tests))
    image = picture(report.plot, 2, 2, SIZE, report.summary())
    return Report(
        kind="design",
        title=f"Design of {Path(file).name} for {significant(math.degrees(goal.slope), 3)}°",
        badge="meets the goal" if report.met else "does not meet the goal",
        meaning=f"at a risk of {100.0 * goal.risk:.0f} %, gravity {report.study.gravity:.4g} m/s²",
        answer=[report.summary()],
        tone="no-gap" if report.met else "bad-data",
        pictures=[ReportPicture("designs", image, "White line: where the goal is met.")],
        tables=tables,
        warnings=list(report.remarks),
        next_steps=[
            f"{one.text}: it leaves {100.0 * one.left:.0f} % of the spread at best ({one.command})"
            for one in report.tests[:3]
        ],
        notation=[
            ("margin", "largest pull up to the slip limit less the weight along the slope."),
            ("margin at risk", "exceeded with the probability that the risk leaves."),
            ("share", "of the variance of the margin, by one input alone."),
            ("lugs needed", "so many that the soil between them moves with the wheel."),
        ],
    )
