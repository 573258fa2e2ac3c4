"""`soilml pull`: drawbar pull against slip and the slope that can be climbed, with bands."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_effects_option,
    add_gear_option,
    add_report_option,
    add_row_options,
    number,
    report_outputs,
)
from soilml.io.atomic_files import output_files

HELP = "drawbar pull against slip, and the slope that can be climbed"
DESCRIPTION = """\
Predict the drawbar pull of a running gear against slip on the soil of the
measured rows, and the slope that a vehicle with such gears can climb, both
with 90 % bands.

  soilml pull MODEL.toml RUNS.csv --picture pull.png
  soilml pull MODEL.toml RUNS.csv --load 80,120 --slip-limit 0.3 --out pull.csv
  soilml pull MODEL.toml RUNS.csv --from exported/wheel.onnx

RUNS.csv is that of `soilml identify`: run, slip, load_N, torque_Nm and, where
measured, drawbar_pull_N and sinkage_m. Samples of the soil are drawn from the
posterior given the rows (--free names its parameters), or from the estimate of
a trained model (--from), and the model computes the pull of each. All rows are
assumed to come from one soil, unless --by run asks for a result for each run.

Loads are those of the rows, unless --load names others. Slips reach 0.6, the
highest measured slip, or --slip-limit. On a slope, a wheel carries the
component of its load normal to the slope and pulls the component along it. The
bands include errors of the model where [discrepancy] states that of the pull,
but neither load transfer nor side slopes.

A model file with [rover] answers for the whole rover, unless --load or --gear
names one wheel: the slip that slopes need, the margin of pull, the work of the
wheels for each metre, the steepest slope and the best slip, with the load of
each wheel on the slope. --gravity moves it to another planet.

  soilml pull ROVER.toml RUNS.csv --slope 0,10,15 --gravity moon

pull, p05, p95 are the median and the 90 % band; `prior` is the band before any
measurement. A value with a warning that it is not known is no more accurate
than the prior. The CSV file has a row for each load and slip, in SI units.
--report writes a page to read and print.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs", type=InputFile, metavar="RUNS.csv", help="measured rows, CSV or Parquet"
    )
    parser.add_argument("--load", help="vertical loads in N: A,B,... or start:stop:count")
    parser.add_argument("--slope", metavar="A,B,...", help="slopes of a rover in degrees")
    parser.add_argument(
        "--gravity", metavar="G", help="gravity of a rover: earth, moon, mars, or in m/s^2"
    )
    parser.add_argument("--slip-limit", type=number, metavar="S", help="largest slip considered")
    parser.add_argument(
        "--free", metavar="A,B,...", help="unknown parameters (default: those with a prior)"
    )
    parser.add_argument(
        "--from",
        dest="trained",
        type=InputFile,
        metavar="MODEL.onnx",
        help="take the soil from the estimate of this model file",
    )
    add_effects_option(parser)
    add_gear_option(parser)
    parser.add_argument(
        "--by", metavar="COLUMN", help="one result for each value of this column, such as run"
    )
    add_row_options(parser)
    parser.add_argument(
        "--as-usual",
        action="store_true",
        help="allow for the errors that sensors and models usually have, as in identify",
    )
    parser.add_argument("--out", metavar="FILE.csv", help="write the curves to this file")
    parser.add_argument("--picture", metavar="FILE.png", help="draw the curves and bands")
    add_report_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [
        *output_files(args.out, ".csv"),
        *output_files(args.picture, ".png"),
        *report_outputs(args),
    ]


def run(args: argparse.Namespace) -> int:
    """Predict and write the results."""
    from soilml.cli.execution.pull import run

    return run(args)
