"""A rover's performance on the soil of measured rows: prediction, columns, report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.wheeled_rover import GRAVITY
from soilml.errors import InputError
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.read_table import Rows, as_table
from soilml.numerics.quantiles import band_columns, quantile_band
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_quantity, format_range
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.traction.draws import DrawnErrors, SoilDraws
from soilml.traction.gravity import draws_at_gravity, gravity_remark
from soilml.traction.measured_range import (
    MeasuredRange,
    band_content,
    extrapolations,
    slip_grid,
)
from soilml.traction.pull_and_slope import excluded_effects
from soilml.traction.rover_performance import LARGEST_SLOPE, RoverPerformance, rover_performance
from soilml.traction.soil_draws import measured_soil

FEWEST = 0.5  # Share of draws that climb a slope below which nothing is said of the slip there
SLOPES = np.deg2rad([0.0, 5.0, 10.0, 15.0, 20.0])  # Slopes that are looked at by default, rad
#: Gravity, m/s^2, and relative difference from it, from which on it is not the Earth's.
EARTH, OTHER_GRAVITY = GRAVITY["earth"], 0.02


@dataclass(frozen=True, repr=False)
class RoverReport(Result):
    """A rover's performance by the posterior, the steepest slope by the prior (rad), warnings."""

    rows: int
    measured_range: MeasuredRange
    performance: RoverPerformance
    prior_steepest: Floats
    warnings: tuple[Remark, ...]

    def frame_columns(self) -> dict[str, Any]:
        """A row for each slope: medians and ends of 90 % bands, SI units."""
        own = self.performance
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

    def report(self, title: str = "Rover on slopes") -> Report:
        """The steepest slope, slip and work by slope, wheels, and what limits them."""
        own = self.performance
        still = float(np.mean(~np.isfinite(own.steepest_slope)))
        slips = format_range(*self.measured_range.slip, digits=2)
        loads = format_range(*self.measured_range.load)
        return Report(
            kind="pull",
            verdict=_verdict(self, still),
            lines=list(_lines(self, still)),
            tables=[_slopes(self), *_wheels(self)],
            pictures=[_picture(self)],
            remarks=self.warnings,
            next_steps=["stay below the lower end of the band, or measure rows that narrow it"],
            status="does not move" if still > FEWEST else "moves",
            tone="bad" if still > FEWEST else "good",
            title=title,
            basis=f"{self.rows} rows at slips {slips}, loads {loads} N; {len(own.loads)} wheels",
            notation=[
                ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
                ("climbed", "share of the soils, which the rows allow, that the rover climbs."),
                ("margin", "largest pull less the weight along the slope."),
            ],
        )


def rover_report(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    slopes: Floats | None = None,
    slip_limit: float | None = None,
    exact_model: bool = False,
    gravity: GravityChange | None = None,
) -> RoverReport:
    """Performance of the case's rover on the soil that the rows were measured on.

    case: With a rover. `soilml.config.case.Case` describes the rest.
    table: Measured rows of one soil. A column `wheel` that names wheels of the rover stands for the
        gear and the pass of its rows.
    free: Paths of the unknown parameters; by default those with a prior.
    slopes: From 0 to 60 degrees, rad; by default 0 to 20 degrees in steps of 5, where all wheels
        stay on the ground.
    slip_limit: Highest slip; by default the highest measured one, at least 0.6.
    exact_model: Whether the soil is that of the model taken as exact, and not averaged over
        explanations as in `identify`.
    gravity: Gravity of the rows, and of the rover in place of that of the case, with a law of the
        soil. By default the rows are from where the rover is.

    Raises `InputError` as `rover_performance` does, or for a slip limit outside (0, 1); `FitError`,
    `TableError` as `identify`.
    """
    case = as_case(case)
    if case.rover is None:
        raise InputError("the model file has no [rover]")
    if slopes is None:
        tipping = case.rover.tipping_slope(float(LARGEST_SLOPE))
        slopes = SLOPES[tipping >= SLOPES]
    table = with_rover_columns(case, as_table(table))
    soil = measured_soil(case, table, free, exact_model)
    case, table = soil.case, table.rows(table.answered)
    if gravity is not None:
        case = with_gravity(case, gravity.target)
    measured = MeasuredRange.of(table["slip"], table["load_N"])
    slip = slip_grid(slip_limit, measured)
    key = column("speed")
    speed = float(np.nanmedian(table[key])) if key in table else None
    assert case.rover is not None
    loads = np.ravel(case.rover.loads(slopes)).tolist()
    draws, prior = soil.with_errors(slip, loads, CHANNELS)
    if gravity is not None:
        draws, prior = (draws_at_gravity(case, d, gravity) for d in (draws, prior))
    found = rover_performance(case, draws, slopes, slip, speed)
    before = _steepest_before(case, prior, slip, speed)
    warnings = (*soil.warnings, *_warnings(case, found, measured, prior.errors, gravity))
    return RoverReport(len(table), measured, found, before, warnings)


def with_gravity(case: Case, gravity: float) -> Case:
    """The case with its rover under another gravity, m/s^2."""
    if case.rover is None:
        raise InputError("--gravity needs a model file with [rover]")
    return replace(case, rover=replace(case.rover, gravity=gravity))


def _steepest_before(case: Case, draws: SoilDraws, slip: Floats, speed: float | None) -> Floats:
    """Steepest slope by the prior, (n,); NaN where most of its soils do not carry the rover."""
    try:
        return rover_performance(case, draws, np.zeros(1), slip, speed).steepest_slope
    except InputError:
        return np.full(len(draws.values), np.nan)


def _warnings(
    case: Case,
    found: RoverPerformance,
    measured: MeasuredRange,
    errors: DrawnErrors | None,
    gravity: GravityChange | None,
) -> Iterator[Remark]:
    assert case.rover is not None
    slip, loads = np.asarray(found.slip_limit), np.stack(list(found.loads.values()))
    yield from extrapolations(slip, loads, measured, errors is not None)
    if gravity is not None and gravity.ratio != 1.0:
        yield gravity_remark(gravity)
    elif abs(case.rover.gravity / EARTH - 1.0) > OTHER_GRAVITY:
        yield Remark(
            "other-gravity",
            f"gravity is {case.rover.gravity:.3g} m/s^2, of the rows too: if these are from "
            "elsewhere, the soil may have other parameters (--gravity, --tested-at)",
        )
    tipping = case.rover.tipping_slope(float(LARGEST_SLOPE))
    if np.nanmean(found.steepest_slope > tipping - 1e-3) > 0.05:
        yield Remark("tipping", f"a wheel leaves the ground at {np.rad2deg(tipping):.1f} deg")
    yield from excluded_effects(case)
    yield band_content(
        errors,
        "all wheels driven at one slip, loads of equally stiff wheels, no side slope",
    )


def _verdict(found: RoverReport, still: float) -> str:
    if still > FEWEST:
        share = format_quantity(still, "share", digits=2)
        return f"The rover does not move: {share} of the soils do not let it."
    own = found.performance
    steepest = quantile_band(own.steepest_slope).text("rad")
    return f"The rover climbs {steepest} at slips up to {own.slip_limit:.2g}."


def _lines(found: RoverReport, still: float) -> Iterator[str]:
    if still > FEWEST:
        return
    yield f"The best slip on level ground is {quantile_band(found.performance.best_slip).text()}."
    if np.isfinite(found.prior_steepest).any():
        before = quantile_band(found.prior_steepest).text("rad")
        yield f"Before the rows, the steepest slope was {before}."
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
               for n, values in found.frame_columns().items()}  # fmt: skip
    return column_picture(
        columns,
        "slope_rad",
        [("slip",), ("margin_N",), ("energy_J_per_m",), ("probability_climbed",)],
        title="The rover on slopes",
        caption="Lines: medians. Bands: 90 % of the soils that the rows allow.",
    )
