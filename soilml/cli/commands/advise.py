"""`soilml advise`: which measurement to make next."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_effects_option,
    add_gear_option,
    add_row_options,
    whole_number,
)
from soilml.io.atomic_files import output_files

HELP = "the next measurement that reduces the uncertainty most"
DESCRIPTION = """\
Rank the operating points (slip, load) and sensors of a next measurement by how
much they reduce the uncertainty of the parameters that have a prior in
MODEL.toml.

  soilml advise MODEL.toml RUNS.csv
  soilml advise MODEL.toml RUNS.csv --slips 0.1,0.3,0.5 --loads 30:120:4
  soilml advise MODEL.toml --loads 30:120:4 --picture map.png

For each candidate, readings are simulated for samples of the posterior (of the
prior without RUNS.csv), and the standard deviation of the exact posterior is
averaged over them. <parameter>_left is this expected standard deviation
divided by that of the prior (1: nothing learned). The rows of the table are:
the best candidate for all parameters together and for each parameter, the best
repetition of a measured row, and the best sequence of --count rows, whose
widths are those after all rows up to it. --all lists every candidate instead.

Candidate channels are those whose noise is declared in [noise]: torque alone,
and torque with each other channel. Without --loads, loads from half to twice
the measured ones are tried. A point is excluded where a twentieth or more of
the posterior samples does not carry the wheel. Model errors are considered where
[discrepancy] declares them.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs",
        type=InputFile,
        metavar="RUNS.csv",
        nargs="?",
        help="rows measured so far, CSV or Parquet",
    )
    parser.add_argument(
        "--slips", metavar="A,B,...", help="candidate slips: A,B,... or start:stop:count"
    )
    parser.add_argument("--loads", metavar="A,B,...", help="candidate loads in N")
    parser.add_argument(
        "--count",
        type=whole_number,
        default=3,
        help="number of rows in the planned sequence, 1 to 5 (default: 3)",
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="parameters to identify (default: those with a prior)"
    )
    parser.add_argument("--all", action="store_true", help="list every candidate, best first")
    add_effects_option(parser)
    add_gear_option(parser)
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="write the table to this file")
    parser.add_argument(
        "--picture", metavar="FILE.png", help="draw maps of the expected width over slip and load"
    )


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [*output_files(args.out, ".csv"), *output_files(args.picture, ".png")]


def run(args: argparse.Namespace) -> int:
    """Rate all candidates and write the table."""
    from soilml.cli.execution.advise import run

    return run(args)
