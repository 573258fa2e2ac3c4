"""`soilml estimate`: a trained model applied to measured rows, as on board."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import InputFile, add_report_option, add_row_options, report_outputs
from soilml.io.atomic_files import output_files

#: Names of `soilml.onboard.multi_sensor.ACROSS_FILES`, which takes a numerical library to import.
FUSION_RULES = (
    "correlated",
    "prior-once",
    "covariance-intersection",
    "inverse-variance",
    "pairwise",
)

HELP = "soil parameters or slip from measured rows, by a trained model"
DESCRIPTION = """\
Estimate soil parameters, or slip, with the model file MODEL.onnx. The results
are those of the onboard runtime.

  soilml estimate exported/wheel.onnx
  soilml estimate exported/wheel.onnx RUNS.csv --out estimates.csv
  soilml estimate exported/wheel.onnx RUNS.csv --by run
  soilml estimate exported/any_wheel.onnx RUNS.csv --case MODEL.toml --by run
  soilml estimate slip_torque.onnx RUNS.csv --with slip_vibration.onnx

Without a table, one line tells what the file is for: wheel, effects and priors.
--case compares them with those of your model file, and refuses another wheel.

Each row of the table gives mean, standard deviation (_std) and 90 % interval
(_p05, _p95) of every parameter, and in_range. in_range is 0 where the readings
lie outside the training data; the estimate is then the prior.

One row gives one equation for three unknowns, so the estimate of a single row
is close to the prior. --by run pools all rows of a run, which is far more
accurate, and --by all those of all runs, which must then be on one soil.
sinkage_m, drawbar_pull_N and <column>_std are used where the table has them,
slip_std and load_N_std included. The estimate of a run is the prior
where more than a tenth of its rows is out of range, and widened as far as the
misfit says where no soil explains them all. A run gets two answers: as if the
model of wheel and soil were right, and, in columns with _usual, with the errors
that such a model usually has; a [discrepancy] of --case takes the place of the
second answer. A row with a blank reading, or
whose status is not ok, gets a blank estimate. Slip differs from row to row and
has no --by.

--with fuses, row by row, model files that estimate the same parameters from
other sensors: slip files of one data file by the correlation of their errors,
others as if their errors were independent; files that read the same sensors
are then refused. A file takes no part in a row where its reading is blank or
out of range; the column `files` counts those that do. Standard error reports
which parameters are not determined, and the next measurement that would help.
Only numpy and onnxruntime are needed, but for --report, a page to read and
print. CSV files are in SI units; a terminal shows kPa, degrees and mm.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", type=InputFile, metavar="MODEL.onnx", help="trained model file")
    parser.add_argument(
        "runs",
        nargs="?",
        type=InputFile,
        metavar="RUNS.csv",
        help="measured rows, CSV or Parquet; without it, tell what the file is for",
    )
    parser.add_argument(
        "--by",
        metavar="COLUMN",
        help="one estimate for each value of this column, such as run; all: one of all rows",
    )
    parser.add_argument(
        "--with",
        dest="others",
        type=InputFile,
        metavar="OTHER.onnx",
        action="append",
        default=[],
        help="another model file to fuse with; can be repeated",
    )
    parser.add_argument("--rule", help=f"fusion rule of --with: {', '.join(FUSION_RULES)}")
    parser.add_argument(
        "--case",
        type=InputFile,
        metavar="MODEL.toml",
        help="your wheel and effects, which are compared with those of the model file; for a file "
        "for wheels of any size, also your soil, priors and noise",
    )
    parser.add_argument("--gear", metavar="NAME", help="which gear of --case, if it has several")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="write the estimates to this file")
    add_report_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [*output_files(args.out, ".csv"), *report_outputs(args)]


def run(args: argparse.Namespace) -> int:
    """Estimate and write the table."""
    from soilml.cli.execution.estimate import run

    return run(args)
