"""`soilml bevameter`: soil parameters from plate-sinkage and shear tests."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_effects_option,
    add_ignore_extra_option,
)
from soilml.io.atomic_files import output_files

HELP = "soil parameters from plate-sinkage and shear tests, without a wheel"
DESCRIPTION = """\
Fit kc, kphi and n to plate-sinkage tests, and cohesion, friction angle and
shear modulus to shear tests. Say what the tests cannot tell: kc apart from kphi
with plates of one size, cohesion apart from friction at one normal stress, how
far repeats differ, and where the laws do not fit.

  soilml bevameter PLATES.csv SHEAR.csv
  soilml bevameter PLATES.csv --model MODEL.toml --out SOIL.toml
  soilml bevameter SHEAR.csv --out SOIL.toml --picture tests.png

Either table may be missing; their columns tell which is which.

PLATES.csv has test, sinkage_m, pressure_Pa or load_N, and the plate:
plate_radius_m, plate_area_m2 of a round plate, or plate_width_m and
plate_length_m. SHEAR.csv has test, normal_stress_Pa, shear_displacement_m and
shear_stress_Pa; for a ring inner_radius_m, outer_radius_m, angle_rad, torque_Nm,
and load_N or normal_stress_Pa. A blank displacement or angle marks the steady
end of a test. Rows with the same name in the column test are one test. Other
names are taken where the header states units, such as z [mm] and p [kPa].

The unit is the test, not the sample: ranges follow from how tests scatter. The
second range is where the value at another place of the soil would lie, and is
the prior that --out writes for identify and gap, with [[soil.test]]: what the
tests say of the parameters together. With --model, SOIL.toml is that model file
with this soil; without it, [soil] with priors and tests alone.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "tables",
        type=InputFile,
        nargs="+",
        metavar="TABLE.csv",
        help="plate tests, shear tests, or both; CSV or Parquet",
    )
    parser.add_argument(
        "--model",
        type=InputFile,
        metavar="MODEL.toml",
        help="whose gear, noise and other soil values to take",
    )
    parser.add_argument("--out", metavar="SOIL.toml", help="write a model file with this soil")
    parser.add_argument("--json", metavar="FILE.json", help="write estimates and remarks")
    parser.add_argument("--picture", metavar="FILE.png", help="draw the tests and the fitted laws")
    add_ignore_extra_option(parser)
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [
        *output_files(args.out, ".toml"),
        *output_files(args.json, ".json"),
        *output_files(args.picture, ".png"),
    ]


def run(args: argparse.Namespace) -> int:
    """Fit the tests, print the result and write the files."""
    from soilml.cli.execution.bevameter import run

    return run(args)
