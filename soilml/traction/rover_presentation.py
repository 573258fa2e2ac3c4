"""A rover's performance as columns, and what is said and shown of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from soilml.numerics.quantiles import quantile_band
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_band, format_quantity, format_range
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.traction.presentation import band_columns
from soilml.traction.rover_report import RoverReport

FEWEST = 0.5  # Share of draws that climb a slope below which nothing is said of the slip there


def rover_columns(found: RoverReport) -> dict[str, Any]:
    """A row for each slope, in SI units, with medians and 90 % bands."""
    own = found.performance
    columns: dict[str, Any] = {"slope_rad": own.slope, "probability_climbed": own.climbed}
    for name, draws in (
        ("slip", own.slip),
        ("margin_N", own.margin),
        ("energy_J_per_m", own.energy),
        ("steepest_slope_rad", own.steepest_slope[:, None] + 0.0 * own.slope),
    ):
        columns |= band_columns(name, draws)
    for name in own.loads:
        columns[f"load_N_{name}"] = own.loads[name]
        columns[f"torque_Nm_{name}"] = quantile_band(own.torque[name]).middle
        columns[f"sinkage_m_{name}"] = quantile_band(own.sinkage[name]).middle
    return columns


def report_of_rover(found: RoverReport, title: str = "Rover on slopes") -> Report:
    """The report of a rover's performance."""
    own = found.performance
    still = float(np.mean(~np.isfinite(own.steepest_slope)))
    slips = format_range(*found.measured_range.slip, digits=2)
    loads = format_range(*found.measured_range.load)
    return Report(
        kind="pull",
        verdict=_verdict(found, still),
        lines=list(_lines(found, still)),
        tables=[_slopes(found), *_wheels(found), *([found.laws.table()] if found.laws else [])],
        pictures=[_picture(found)],
        remarks=found.warnings,
        next_steps=["stay below the lower end of the band, or measure rows that narrow it"],
        status="does not move" if still > FEWEST else "moves",
        tone="bad" if still > FEWEST else "good",
        title=title,
        basis=f"{found.rows} rows at slips {slips}, loads {loads} N; {len(own.loads)} wheels",
        notation=[
            ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
            ("climbed", "share of the soils, which the rows allow, that the rover climbs."),
            ("margin", "largest pull less the weight along the slope."),
        ],
    )


def _band(draws: Any, unit: str = "1") -> str:
    band = quantile_band(draws)
    return format_band(float(band.lower), float(band.middle), float(band.upper), unit)


def _verdict(found: RoverReport, still: float) -> str:
    if still > FEWEST:
        share = format_quantity(still, "share", digits=2)
        return f"The rover does not move: {share} of the soils do not let it."
    own = found.performance
    steepest = _band(own.steepest_slope, "rad")
    return f"The rover climbs {steepest} at slips up to {own.slip_limit:.2g}."


def _lines(found: RoverReport, still: float) -> Iterator[str]:
    if still > FEWEST:
        return
    yield f"The best slip on level ground is {_band(found.performance.best_slip)}."
    if np.isfinite(found.prior_steepest).any():
        yield f"Before the rows, the steepest slope was {_band(found.prior_steepest, 'rad')}."
    if still > 0.0:
        share = format_quantity(still, "share", digits=2)
        yield f"{share} of the soils do not let the rover move."


def _slopes(found: RoverReport) -> ReportTable:
    own, enough = found.performance, found.performance.climbed >= FEWEST
    slip, margin, work = (quantile_band(v) for v in (own.slip, own.margin, own.energy))
    blank = np.where(enough, 0.0, np.nan)
    columns = [
        Column("slope", own.slope.tolist(), "rad", digits=3),
        Column("climbed", own.climbed.tolist(), "share", digits=3),
    ]
    for head, band, unit, hidden in (
        ("slip", slip, "1", blank),
        ("margin", margin, "N", 0.0),
        ("work", work, "J/m", blank),
    ):
        ends = ((band.lower + hidden).tolist(), (band.upper + hidden).tolist())
        columns.append(Column(head, (band.middle + hidden).tolist(), unit, ends=ends))
    return ReportTable("Slopes", columns)


def _wheels(found: RoverReport) -> Iterator[ReportTable]:
    """Loads, torques and sinkages on the steepest of the slopes that most draws climb."""
    own = found.performance
    climbed = np.flatnonzero(own.climbed >= FEWEST)
    if not climbed.size:
        return
    at = int(climbed[-1])
    torque = [quantile_band(own.torque[name][:, at]) for name in own.loads]
    sinkage = [quantile_band(own.sinkage[name][:, at]) for name in own.loads]
    yield ReportTable(
        f"Wheels on {format_quantity(float(own.slope[at]), 'rad')}",
        [
            Column("wheel", list(own.loads)),
            Column("pass", [own.passes[name] for name in own.loads]),
            Column("load", [float(load[at]) for load in own.loads.values()], "N"),
            Column.of_bands("torque", torque, "N m"),
            Column.of_bands("sinkage", sinkage, "m"),
        ],
    )


def _picture(found: RoverReport) -> Picture:
    enough = found.performance.climbed >= FEWEST
    columns = {n: np.where(enough | n.startswith(("slope", "prob", "margin")), values, np.nan)
               for n, values in rover_columns(found).items()}  # fmt: skip
    return column_picture(
        columns,
        "slope_rad",
        [("slip",), ("margin_N",), ("energy_J_per_m",), ("probability_climbed",)],
        title="The rover on slopes",
        caption="Lines: medians. Bands: 90 % of the soils that the rows allow.",
    )
