"""`soilml climb`: the slope that a rover can climb, from its first climbs of gentle slopes."""

from __future__ import annotations

import argparse
from math import pi
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import check_seed
from soilml.cli.output import is_terminal, json_text, write_stdout
from soilml.cli.output_names import CLIMB_FILES
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_outputs, create_folder, save_text
from soilml.io.text_tables import csv_text, format_table

if TYPE_CHECKING:
    from soilml.numerics.quantile_band import QuantileBand
    from soilml.systems.climbing.files.report import ClimbingReport

#: Number of slips in the printed curve.
PRINTED_SLIPS = 9
#: Units of the printed tables: factor and name.
_UNITS = {"rad": (180.0 / pi, "deg"), "m": (1e3, "mm")}


def run(args: argparse.Namespace) -> int:
    """Identify, predict and deliver."""
    from soilml.systems.climbing.files.read_tables import read_climb_data
    from soilml.systems.climbing.files.report import climbing_report
    from soilml.systems.climbing.files.rover_file import read_rover

    check_seed(args)
    if args.slip_limit is not None and not 0.0 < args.slip_limit < 1.0:
        raise InputError(f"--slip-limit is {args.slip_limit:g}; needed is a slip from 0 to 1")
    file = read_rover(args.rover)
    data = read_climb_data(args.runs, args.stress, file.stress, ignore_extra=args.ignore_extra)
    report = climbing_report(file, data, slip_limit=args.slip_limit, seed=args.seed)
    text = json_text(report.as_json())
    if args.out is None and not is_terminal():
        write_stdout(text)
        return 0
    if args.out is not None and args.out.lower().endswith(".json"):
        save_text(args.out, text)
    elif args.out is not None:
        texts = (text, csv_text(_curve(report)), csv_text(_runs(report)))
        with (
            create_folder(args.out) as folder,
            atomic_outputs([folder / name for name in CLIMB_FILES]) as parts,
        ):
            for part, content in zip(parts, texts, strict=True):
                part.write_text(content, encoding="utf-8")
    print(_text(report))
    return 0


def _curve(report: ClimbingReport) -> dict[str, Any]:
    pull, slope = report.pull, report.slope
    return {
        "slip": report.ability.slip,
        "drawbar_pull_N": pull.middle,
        "drawbar_pull_N_p05": pull.lower,
        "drawbar_pull_N_p95": pull.upper,
        "slope_rad": slope.middle,
        "slope_rad_p05": slope.lower,
        "slope_rad_p95": slope.upper,
    }


def _runs(report: ClimbingReport) -> dict[str, Any]:
    from soilml.systems.climbing.files.report import SPEED_ERROR

    climbs = report.data.climbs
    return {
        "run": [c.name for c in climbs],
        "slope_rad": [c.slope for c in climbs],
        "slip_front": [c.front.slip for c in climbs],
        "slip_rear": [c.rear.slip for c in climbs],
        "off_N": report.ground.residual,
        "off_N_std": report.ground.residual_std,
        "shear_modulus_m_if_speed_low": report.modulus_per_climb[-SPEED_ERROR],
        "shear_modulus_m": report.modulus_per_climb[0.0],
        "shear_modulus_m_if_speed_high": report.modulus_per_climb[SPEED_ERROR],
    }


def _text(report: ClimbingReport) -> str:
    from soilml.numerics.quantile_band import quantile_band

    fit, ability = report.ground.fit, report.ability
    best, where = quantile_band(ability.steepest), quantile_band(ability.steepest_slip)
    slopes_text = [
        f"steepest slope {_band_text(best, _UNITS['rad'][0], '.1f')} deg, at slip "
        f"{_band_text(where, 1.0, '.2f')}"
    ]
    if report.slip_limit is not None:
        within = quantile_band(ability.steepest_within(report.slip_limit))
        text = _band_text(within, _UNITS["rad"][0], ".1f")
        slopes_text.append(f"steepest slope at slips up to {report.slip_limit:g}: {text} deg")
    climbs, slopes = fit.rows_used, report.ground.distinct_slopes
    parts = [
        f"{climbs} climb{'s'[: climbs > 1]} on {slopes} slope{'s'[: slopes > 1]}",
        format_table(("parameter", "value", "std", "unit", "posterior/prior"), _parameters(report)),
        format_table(
            ("slip", "pull_N", "p05", "p95", "slope_deg", "p05", "p95"),
            [
                _point(report, i * (len(ability.slip) - 1) // (PRINTED_SLIPS - 1))
                for i in range(PRINTED_SLIPS)
            ],
            text_columns=0,
        ),
        "\n".join(slopes_text),
        "\n".join(f"! {text}" for text in report.warnings),
    ]
    return "\n\n".join(part for part in parts if part)


def _parameters(report: ClimbingReport) -> list[tuple[str, ...]]:
    from soilml.quantities import NOT_IDENTIFIED_ABOVE

    fit = report.ground.fit
    rows: list[tuple[str, ...]] = []
    units = {"cohesion": "Pa", "friction_angle": "rad", "shear_modulus": "m"}
    for (name, unit), value in zip(units.items(), report.ground.shear, strict=True):
        factor, unit_text = _UNITS.get(unit, (1.0, unit))
        if name in fit.names:
            std = f"{factor * fit.std[fit.names.index(name)]:.2g}"
            left = fit.remaining_fraction[name]
            text = "not identified" if left > NOT_IDENTIFIED_ABOVE else f"{factor * value:.4g}"
            rows.append((name, text, std, unit_text, f"{left:.0%}"))
        else:
            rows.append((name, f"{factor * value:.4g}", "fixed", unit_text, ""))
    return rows


def _point(report: ClimbingReport, i: int) -> tuple[str, ...]:
    """A line of the curve."""
    line = [f"{report.ability.slip[i]:.3f}"]
    for values, factor in ((report.pull, 1.0), (report.slope, _UNITS["rad"][0])):
        line += [f"{factor * v[i]:.1f}" for v in (values.middle, values.lower, values.upper)]
    return tuple(line)


def _band_text(found: QuantileBand, factor: float, form: str) -> str:
    low, middle, high = (factor * float(v) for v in (found.lower, found.middle, found.upper))
    return f"{middle:{form}} ({low:{form}} to {high:{form}})"
