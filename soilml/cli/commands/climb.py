"""`soilml climb`: the slope that a rover can climb, from its first climbs of gentle slopes."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_ignore_extra_option,
    add_seed_option,
    number,
)
from soilml.cli.output_names import CLIMB_FILES
from soilml.errors import InputError
from soilml.io.atomic_files import output_files

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
are 90 % intervals. DIR receives report.html (start here), climb.json,
curve.csv and climbs.csv.
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
        type=number,
        metavar="S",
        help="give the steepest slope at slips up to S as well",
    )
    add_seed_option(parser)
    add_ignore_extra_option(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for four files, or FILE.json alone")


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
    return [folder / name for name in CLIMB_FILES] if folder.is_dir() else []


def run(args: argparse.Namespace) -> int:
    """Identify, predict and deliver."""
    from soilml.cli.execution.climb import run

    return run(args)
