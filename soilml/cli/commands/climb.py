"""`soilml paper climb`: the slope that a rover can climb, from climbs of gentle ones."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import REQUIRED, InputFile, OutputFile

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Identify cohesion, friction angle and shear modulus of the ground from climbs
of gentle slopes and the measured stress on the rims of a front and a rear
wheel; then predict drawbar pull and the steepest slope that can be climbed.

  soilml paper climb ROVER.toml RUNS.csv --stress STRESS.csv --report FOLDER

ROVER.toml describes a rover with four wheels:

  [rover]       mass (kg), radius and width of a wheel (m), front_share, the
                share of the weight on the front wheels, and height_ratio,
                height of the centre of mass over wheelbase
  [soil]        known parameters, such as cohesion = 0.0 (Pa)
  [soil.prior]  ranges of the others, such as shear_modulus = [0.001, 0.05] (m)
  [noise]       such as speed_m_s = "0.9 %", slope_rad = 0.005,
                normal_Pa = "5 %", entry_angle_rad, front_load

RUNS.csv has a row for each wheel of each steady run: run, wheel (front or
rear), slope_rad, and either slip or speed_m_s and rim_speed_m_s. A run without
a slope is no climb, such as slip that was imposed on level ground. STRESS.csv
has a row for each sample: run, wheel, angle_rad, normal_Pa.

Each slope gives one equation, so three unknowns need three slopes. The bands
are 90 % intervals. The table is pull and slope over slip; -v and the page of
--report have the climbs too.
"""
ARGUMENTS = (
    ("rover ROVER.toml", "rover, soil and noise", InputFile),
    ("runs RUNS.csv", "runs of the wheels, CSV or Parquet", InputFile),
    ("--stress STRESS.csv", "stress on the rims, CSV or Parquet", InputFile, REQUIRED),
    "seed",
    "ignore-extra",
    ("--out FILE.csv", "write pull and slope over slip to this file", OutputFile),
    ("--picture FILE.png", "draw pull and slope over slip", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Identify, predict and deliver."""
    from soilml.cli.output import deliver
    from soilml.cli.progress import working
    from soilml.systems.rim_stress.climbs import read_rover
    from soilml.systems.rim_stress.report import climbing_report
    from soilml.systems.rim_stress.tables import read_climb_data

    file = read_rover(args.rover)
    data = read_climb_data(
        args.runs, args.stress, file.noise.normal_Pa, ignore_extra=args.ignore_extra
    )
    with working(f"identifying from {len(data.climbs)} climbs"):
        found = climbing_report(file, data, seed=args.seed)
    title = f"Slopes that {Path(args.rover).name} climbs, from {Path(args.runs).name}"
    deliver(args, found.report(title), found.as_json(), found.curve)
    return 0
