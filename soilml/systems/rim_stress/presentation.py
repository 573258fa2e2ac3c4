"""The result of `climb` as text and as a page."""

from __future__ import annotations

from math import pi
from pathlib import Path

from soilml.io.text_tables import format_table
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture, ReportTable
from soilml.report.parameter_lines import ParameterLine, parameter_lines, parameter_table
from soilml.report.terminal import rounded, shown_unit, significant
from soilml.systems.rim_stress.report import FIGURE_SIZE, ClimbingReport

#: Number of slips in the printed curve.
PRINTED_SLIPS = 9
DEGREES = 180.0 / pi


def climb_report(report: ClimbingReport, files: tuple[str, str]) -> Report:
    """The page of `climb`: rover file and table of climbs."""
    fit, ability = report.ground.fit, report.ability
    best, where = quantile_band(ability.steepest), quantile_band(ability.steepest_slip)
    answer = [
        f"The steepest slope is {_band(best, DEGREES, '.1f', '°', '90 %: ')}, at slip "
        f"{_band(where, 1.0, '.2f', note='90 %: ')}."
    ]
    if report.slip_limit is not None:
        within = quantile_band(ability.steepest_within(report.slip_limit))
        text = _band(within, DEGREES, ".1f", "°", "90 %: ")
        answer.append(f"At slips up to {report.slip_limit:g} it is {text}.")
    lines = _lines(report)
    answer += [line.sentence for line in lines]
    rows = []
    for i in _printed(report):
        slip, *cells = _point(report, i)
        pull, slope = cells[:3], cells[3:]
        ends = [f"{low} to {high}" for _, low, high in (pull, slope)]
        cells = [slip, pull[0], ends[0], slope[0], ends[1]]
        rows.append([cell.replace("-", "−") for cell in cells])
    known = all(line.known for line in lines)
    return Report(
        kind="climb",
        title=f"Slopes that {Path(files[0]).name} climbs, from {Path(files[1]).name}",
        badge="predicted" if known else "partly known",
        meaning=f"from {fit.rows_used} climbs on {report.ground.distinct_slopes} slopes",
        answer=answer,
        tone="named" if known else "suspected",
        pictures=[
            ReportPicture(
                "Pull and slope over slip",
                picture(report.plot, 1, 2, FIGURE_SIZE, answer[0]),
                "Lines: medians, with bands of 90 %. Dots: the climbs, at the mean slip of both "
                "wheels.",
            )
        ],
        tables=[
            parameter_table({"": lines}, None),
            ReportTable(
                "Pull and slope over slip", ["slip", "pull, N", "90 %", "slope, °", "90 %"], rows
            ),
        ],
        warnings=report.warnings,
        next_steps=["Climb a steeper slope within the band, and run the command again."],
        notation=[("90 %", "from the 5 % to the 95 % quantile; medians before them.")],
    )


def _lines(report: ClimbingReport) -> list[ParameterLine]:
    fit = report.ground.fit
    left = [fit.remaining_fraction.get(name) for name in fit.names]
    return parameter_lines(fit.names, fit.units, fit.values, fit.std, *fit.interval, left)


def _printed(report: ClimbingReport) -> list[int]:
    last = len(report.ability.slip) - 1
    return [i * last // (PRINTED_SLIPS - 1) for i in range(PRINTED_SLIPS)]


def climb_text(report: ClimbingReport) -> str:
    """The soil, the curve, the steepest slope, and the warnings."""
    fit, ability = report.ground.fit, report.ability
    best, where = quantile_band(ability.steepest), quantile_band(ability.steepest_slip)
    slopes_text = [
        f"steepest slope {_band(best, DEGREES, '.1f')} deg, at slip {_band(where, 1.0, '.2f')}"
    ]
    if report.slip_limit is not None:
        within = quantile_band(ability.steepest_within(report.slip_limit))
        text = _band(within, DEGREES, ".1f")
        slopes_text.append(f"steepest slope at slips up to {report.slip_limit:g}: {text} deg")
    climbs, slopes = fit.rows_used, report.ground.distinct_slopes
    parts = [
        f"{climbs} climb{'s'[: climbs > 1]} on {slopes} slope{'s'[: slopes > 1]}",
        format_table(("parameter", "value", "std", "unit", "posterior/prior"), _parameters(report)),
        format_table(
            ("slip", "pull_N", "p05", "p95", "slope_deg", "p05", "p95"),
            [_point(report, i) for i in _printed(report)],
            text_columns=0,
        ),
        "\n".join(slopes_text),
        "\n".join(f"! {text}" for text in report.warnings),
    ]
    return "\n\n".join(part for part in parts if part)


def _parameters(report: ClimbingReport) -> list[tuple[str, ...]]:
    fit = report.ground.fit
    rows: list[tuple[str, ...]] = []
    units = {"cohesion": "Pa", "friction_angle": "rad", "shear_modulus": "m"}
    for (name, unit), value in zip(units.items(), report.ground.shear, strict=True):
        factor, unit_text = shown_unit(unit)
        if name in fit.names:
            std = factor * float(fit.std[fit.names.index(name)])
            left = fit.remaining_fraction[name]
            text = rounded(factor * float(value), std)
            text = "not identified" if left > NOT_IDENTIFIED_ABOVE else text
            rows.append((name, text, rounded(std, std), unit_text, f"{left:.0%}"))
        else:
            rows.append((name, significant(factor * float(value)), "fixed", unit_text, ""))
    return rows


def _point(report: ClimbingReport, i: int) -> tuple[str, ...]:
    """A line of the curve."""
    line = [f"{report.ability.slip[i]:.3f}"]
    for values, factor in ((report.pull, 1.0), (report.slope, DEGREES)):
        line += [f"{factor * v[i]:.1f}" for v in (values.middle, values.lower, values.upper)]
    return tuple(line)


def _band(found: QuantileBand, factor: float, form: str, unit: str = "", note: str = "") -> str:
    low, middle, high = (factor * float(v) for v in (found.lower, found.middle, found.upper))
    return f"{middle:{form}}{unit} ({note}{low:{form}} to {high:{form}}{unit})"
