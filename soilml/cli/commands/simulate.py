"""`soilml simulate`: forces on a running gear over slip and load."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_effects_option,
    add_gear_option,
    number,
)
from soilml.io.atomic_files import output_files

HELP = "forces and sinkage against slip and load, from a model"
DESCRIPTION = """\
Solve the equilibrium of gear and soil of MODEL.toml at every combination of
the slips and loads.

  soilml simulate MODEL.toml --slip 0:0.6:13 --load 60 --out curve.csv
  soilml simulate MODEL.toml --slip -0.3,0,0.3 --load 30:120:4 --run sim

Ranges are start:stop:count, or values with commas. With --run, `soilml
identify` can read the table. A row without equilibrium has blank values and
the reason in the column `status`; it is an error if no row has an equilibrium.
Without --out the table is printed, aligned on a terminal and as CSV into a
pipe.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil and effects"
    )
    parser.add_argument(
        "--slip", required=True, help="slip ratios, above 0 driving, below 0 braking"
    )
    parser.add_argument("--load", required=True, help="vertical loads in N")
    parser.add_argument(
        "--speed", type=number, metavar="M_S", help="speed in m/s, below 0 in reverse"
    )
    parser.add_argument(
        "--pass", dest="passes", type=number, help="number of the pass: 1 on undisturbed soil"
    )
    parser.add_argument(
        "--slip-angle",
        type=number,
        metavar="RAD",
        help="angle between wheel plane and path, in rad",
    )
    add_effects_option(parser)
    add_gear_option(parser)
    parser.add_argument(
        "--run", dest="label", metavar="NAME", help="add a first column `run` with this name"
    )
    parser.add_argument("--out", metavar="FILE.csv", help="write the table to this file")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Simulate and write the table."""
    from soilml.cli.execution.simulate import run

    return run(args)
