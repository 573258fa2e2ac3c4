"""`soilml paper climb`: the slope that a rover can climb, from climbs of gentle ones."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import REQUIRED, InputFile, folder_outputs
from soilml.io.atomic_files import write_files

#: Files of the folder of --out.
FILES = ("report.html", "climb.json", "curve.csv", "climbs.csv")
FORMATS = ("table", "json")
DESCRIPTION = """\
Identify cohesion, friction angle and shear modulus of the ground from climbs
of gentle slopes and the measured stress on the rims of a front and a rear
wheel; then predict drawbar pull and the steepest slope that can be climbed.

  soilml paper climb ROVER.toml RUNS.csv --stress STRESS.csv --out FOLDER

ROVER.toml describes a rover with four wheels:

  [rover]       mass (kg), radius and width of a wheel (m), front_share, the
                share of the weight on the front wheels, and height_ratio,
                height of the centre of mass over wheelbase
  [soil]        known parameters, such as cohesion = 0.0 (Pa)
  [soil.prior]  ranges of the others, such as shear_modulus = [0.001, 0.05] (m)
  [noise]       such as speed_m_s = "0.9 %", slope_rad = 0.005,
                normal_Pa = "5 %", entry_angle_rad, speed_scale, front_load

RUNS.csv has a row for each wheel of each steady climb: run, wheel (front or
rear), slope_rad, and either slip or speed_m_s and rim_speed_m_s. STRESS.csv
has a row for each sample: run, wheel, angle_rad, normal_Pa, and slip where the
run is no climb (imposed slip on level ground).

Each slope gives one equation, so three unknowns need three slopes. The bands
are 90 % intervals. FOLDER receives report.html, climb.json, curve.csv,
climbs.csv.
"""
ARGUMENTS = (
    ("rover ROVER.toml", "rover, soil and noise", InputFile),
    ("runs RUNS.csv", "climbs, CSV or Parquet", InputFile),
    ("--stress STRESS.csv", "stress on the rims, CSV or Parquet", InputFile, REQUIRED),
    "seed",
    "ignore-extra",
    ("--out FOLDER", "folder for the four files"),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    return folder_outputs("--out", args.out, FILES)


def run(args: argparse.Namespace) -> int:
    """Identify, predict and deliver."""
    from soilml.cli.output import origin_of, show_result
    from soilml.cli.progress import working
    from soilml.io.text_tables import csv_text
    from soilml.optional_imports import need
    from soilml.report.page import report_texts
    from soilml.systems.rim_stress.climbs import read_rover
    from soilml.systems.rim_stress.report import climbing_report
    from soilml.systems.rim_stress.tables import read_climb_data

    if args.out is not None:
        for library in ("jinja2", "matplotlib"):
            need(library, "paper climb")
    file = read_rover(args.rover)
    data = read_climb_data(
        args.runs, args.stress, file.noise.normal_Pa, ignore_extra=args.ignore_extra
    )
    with working(f"identifying from {len(data.climbs)} climbs"):
        found = climbing_report(file, data, seed=args.seed)
    content = found.as_json()
    page = found.report(f"Slopes that {Path(args.rover).name} climbs, from {Path(args.runs).name}")
    if args.out is not None:
        html, result, curve, climbs = FILES
        target = Path(args.out)
        contents = report_texts(page, origin_of(args), content, (html, result), target)
        contents |= {target / curve: csv_text(found.curve)}
        contents |= {target / climbs: csv_text(found.climbs)}
        write_files(contents, folders=[args.out])
    show_result(page, content)
    return 0
