"""A rover's performance as text, as columns, and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from soilml.config.wheeled_rover import WheeledRover
from soilml.io.text_tables import format_table
from soilml.numerics.quantiles import quantile_band
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture, ReportTable
from soilml.traction.presentation import Presentation, band_columns
from soilml.traction.rover_report import SIZE, RoverReport

FEWEST = 0.5  # Share of draws that climb a slope below which nothing is said of the slip there


def rover_text(rover: WheeledRover, report: RoverReport) -> str:
    """Tables of slopes and of wheels, the stated answers, and the warnings."""
    measured = report.measured_range
    head = (
        f"{report.rows} rows at slips {measured.slip[0]:.2g} to {measured.slip[1]:.2g}, loads "
        f"{measured.load[0]:.4g} to {measured.load[1]:.4g} N\n"
        f"rover of {rover.mass:g} kg on {len(rover.wheels)} wheels, gravity "
        f"{rover.gravity:.4g} m/s^2"
    )
    parts = [head, _slopes(report), _wheels(report), _answers(report)]
    parts += [] if report.laws is None else [report.laws.text()]
    return "\n\n".join([*parts, "\n".join(f"! {text}" for text in report.warnings)])


def rover_columns(report: RoverReport) -> dict[str, Any]:
    """A row for each slope, in SI units, with medians and 90 % bands."""
    found = report.performance
    columns: dict[str, Any] = {"slope_rad": found.slope, "probability_climbed": found.climbed}
    for name, draws in (
        ("slip", found.slip),
        ("margin_N", found.margin),
        ("energy_J_per_m", found.energy),
        ("steepest_slope_rad", found.steepest_slope[:, None] + 0.0 * found.slope),
    ):
        columns |= band_columns(name, draws)
    for name in found.loads:
        columns[f"load_N_{name}"] = found.loads[name]
        columns[f"torque_Nm_{name}"] = quantile_band(found.torque[name]).middle
        columns[f"sinkage_m_{name}"] = quantile_band(found.sinkage[name]).middle
    return columns


def _slopes(report: RoverReport) -> str:
    header = (
        "slope_deg", "climbed", "slip", "p05", "p95", "margin_N", "p05", "p95", "work_J/m", "p05",
        "p95",
    )  # fmt: skip
    lines = [(*head, *slip, *margin, *work) for head, slip, margin, work in _by_slope(report)]
    return format_table(header, lines, text_columns=0)


def _by_slope(report: RoverReport) -> Iterator[tuple[list[str], ...]]:
    """Slope and share that climbs it; middle and ends of slip, of margin (N), of work (J/m)."""
    found = report.performance
    for i, slope in enumerate(np.rad2deg(found.slope)):
        yield (
            [f"{slope:.3g}", f"{100 * found.climbed[i]:.0f} %"],
            _cells(found.slip[:, i], "{:.2f}", needs=FEWEST),
            _cells(found.margin[:, i], "{:.1f}"),
            _cells(found.energy[:, i], "{:.1f}", needs=FEWEST),
        )


def _wheels(report: RoverReport) -> str:
    """Loads, torques and sinkages on the steepest of the slopes that most draws climb."""
    found = report.performance
    climbed = np.flatnonzero(found.climbed >= FEWEST)
    if not climbed.size:
        return "no slope is climbed by more than half of the soils"
    at = int(climbed[-1])
    header = ("wheel", "pass", "load_N", "torque_Nm", "p05", "p95", "sinkage_mm", "p05", "p95")
    lines = []
    for name, load in found.loads.items():
        cells = [name, str(found.passes[name]), f"{load[at]:.1f}"]
        cells += _cells(found.torque[name][:, at], "{:.2f}")
        cells += _cells(1e3 * found.sinkage[name][:, at], "{:.1f}")
        lines.append(cells)
    table = format_table(header, lines, text_columns=1)
    return f"wheels on {np.rad2deg(found.slope[at]):.3g} deg\n{table}"


def _answers(report: RoverReport) -> str:
    found = report.performance
    still = float(np.mean(~np.isfinite(found.steepest_slope)))
    if still > FEWEST:
        return f"steepest slope  none: {100 * still:.0f} % of the soils do not let it move"
    lines = [
        f"steepest slope  {_range(np.rad2deg(found.steepest_slope), '.1f')} deg, at slips up to "
        f"{found.slip_limit:.2g}; before the rows {_ends(np.rad2deg(report.prior_steepest))} deg",
        f"best slip       {_range(found.best_slip, '.2f')}, where the wheels pull most for their "
        "work on level ground",
    ]
    if still > 0.0:
        lines.append(f"! {100 * still:.0f} % of the soils do not let the rover move")
    return "\n".join(lines)


def _cells(draws: np.ndarray, form: str, needs: float = 0.0) -> list[str]:
    if np.mean(np.isfinite(draws)) <= needs:
        return ["", "", ""]
    band = quantile_band(draws)
    return [form.format(float(v)) for v in (band.middle, band.lower, band.upper)]


def _range(draws: np.ndarray, form: str, unit: str = "") -> str:
    band = quantile_band(draws)
    return f"{band.middle:{form}}{unit} ({band.lower:{form}} to {band.upper:{form}})"


def _ends(draws: np.ndarray) -> str:
    band = quantile_band(draws)
    return f"{band.lower:.1f} to {band.upper:.1f}" if np.isfinite(band.middle) else "not known"


def rover_presentation(rover: WheeledRover) -> Presentation[RoverReport]:
    """What `pull` writes of this rover."""
    return Presentation(
        columns=rover_columns,
        text=partial(rover_text, rover),
        warnings=lambda report: report.warnings,
        page=partial(rover_page, rover),
        panels=lambda report: (2, 2, SIZE),
    )


def rover_page(
    rover: WheeledRover, found: Mapping[str, RoverReport], by: str | None, files: tuple[str, str]
) -> Report:
    """The page of `pull` for a whole rover: performance by group; model file and table."""
    heads = {name: f"{by} {name}: " if by else "" for name in found}
    moves = [_moves(report) for report in found.values()]
    tables = [
        ReportTable(
            f"{heads[name]}slopes",
            ["slope, °", "climbed", "slip", "90 %", "margin, N", "90 %", "work, J/m", "90 %"],
            _page_rows(report),
        )
        for name, report in found.items()
    ]
    images = [
        ReportPicture(
            f"{heads[name]}slopes of the rover",
            picture(report.plot, 2, 2, SIZE, _sentence(report)),
            "Lines: medians. Bands: 90 % of the soils that the rows allow.",
        )
        for name, report in list(found.items())[:MOST_PICTURES]
    ]
    return Report(
        kind="pull",
        title=f"Rover {Path(files[0]).name} on the soil of {Path(files[1]).name}",
        badge="moves" if all(moves) else "does not move" if not any(moves) else "moves in part",
        meaning=f"rover of {rover.mass:g} kg on {len(rover.wheels)} wheels, gravity "
        f"{rover.gravity:.4g} m/s²",
        answer=[heads[name] + _sentence(report) for name, report in found.items()],
        tone="named" if all(moves) else "bad-data",
        pictures=images,
        tables=tables,
        warnings=[
            remark.under(heads[n]) for n, report in found.items() for remark in report.warnings
        ],
        next_steps=["Keep below the lower end of the band, and drive rows that narrow it."],
        notation=[
            ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
            ("climbed", "share of the soils, which the rows allow, that the rover climbs."),
            ("margin", "largest pull less the weight along the slope."),
        ],
    )


MOST_PICTURES = 6  # Most pictures of a page


def _moves(report: RoverReport) -> bool:
    return bool(np.mean(~np.isfinite(report.performance.steepest_slope)) <= FEWEST)


def _sentence(report: RoverReport) -> str:
    found = report.performance
    if not _moves(report):
        still = float(np.mean(~np.isfinite(found.steepest_slope)))
        return f"There is no steepest slope: {still:.0%} of the soils do not let the rover move."
    return (
        f"The steepest slope is {_range(np.rad2deg(found.steepest_slope), '.1f', '°')}, at slips "
        f"up to {found.slip_limit:.2g}; the best slip on level ground is "
        f"{_range(found.best_slip, '.2f')}."
    )


def _page_rows(report: RoverReport) -> list[list[str]]:
    rows = []
    for head, *bands in _by_slope(report):
        cells = [*head]
        for middle, low, high in bands:
            cells += [middle or "–", f"{low} to {high}" if middle else "–"]
        rows.append([cell.replace("-", "−") for cell in cells])
    return rows
