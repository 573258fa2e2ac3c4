"""`soilml climb`: the slope that a rover can climb, from its first climbs of gentle slopes."""

from __future__ import annotations

import argparse
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.options import InputFile, add_ignore_extra_option, add_seed_option, check_seed
from soilml.cli.output import is_terminal, json_text, write_stdout
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_outputs, create_folder, output_files, save_text
from soilml.io.text_tables import csv_text, format_table

if TYPE_CHECKING:
    from soilml.numerics.quantile_band import QuantileBand
    from soilml.systems.climbing.files.report import ClimbingReport

#: Files that the output folder receives.
FILES = ("climb.json", "curve.csv", "climbs.csv")
#: Number of slips in the printed curve.
PRINTED_SLIPS = 9
#: Units of the printed tables: factor and name.
_UNITS = {"rad": (180.0 / pi, "deg"), "m": (1e3, "mm")}

HELP = "the steepest slope a rover with force-sensor wheels can climb"
DESCRIPTION = """\
Identify cohesion, friction angle and shear modulus of the ground from climbs
of gentle slopes and the measured stress on the rims of a front and a rear
wheel; then predict drawbar pull against slip and the steepest slope that can
be climbed.

  soilml climb ROVER.toml RUNS.csv --stress STRESS.csv
  soilml climb ROVER.toml RUNS.csv --stress STRESS.csv --out DIR

ROVER.toml describes a rover with four wheels:

  [rover]       mass (kg), radius and width of a wheel (m); optionally
                front_share, the share of the weight on the front wheels, and
                height_ratio, height of the centre of mass over wheelbase
  [soil]        known parameters, such as cohesion = 0.0 (Pa)
  [soil.prior]  ranges of the others, such as shear_modulus = [0.001, 0.05] (m)
  [noise]       such as speed_m_s = "0.9 %", slope_rad = 0.005,
                normal_Pa = "5 %", entry_angle_rad, speed_scale, front_load

RUNS.csv has a row for each wheel of each steady climb, a repetition being a
run of its own: run, wheel (front or rear), slope_rad, and either slip or
speed_m_s and rim_speed_m_s. STRESS.csv has a row for each sample: run, wheel,
angle_rad, normal_Pa, and slip where the run is no climb (imposed slip on level
ground).

Each slope gives one equation, so three unknowns need three slopes. The bands
are 90 % intervals. DIR receives climb.json, curve.csv and climbs.csv.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("rover", type=InputFile, metavar="ROVER.toml", help="rover, soil and noise")
    parser.add_argument("runs", type=InputFile, metavar="RUNS.csv", help="climbs, CSV or Parquet")
    parser.add_argument(
        "--stress",
        type=InputFile,
        metavar="STRESS.csv",
        required=True,
        help="stress on the rims, CSV or Parquet",
    )
    parser.add_argument(
        "--slip-limit",
        type=float,
        metavar="S",
        help="give the steepest slope at slips up to S as well",
    )
    add_seed_option(parser)
    add_ignore_extra_option(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for three files, or FILE.json alone")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    if args.out is None or args.out.lower().endswith(".json"):
        return output_files(args.out, ".json")
    if not args.out:
        raise InputError("--out is empty; needed is a folder, or a file name ending in .json")
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"--out {args.out} is a file; needed is a folder, or a file name ending in .json"
        )
    return [folder / name for name in FILES] if folder.is_dir() else []


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
            atomic_outputs([folder / name for name in FILES]) as parts,
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
