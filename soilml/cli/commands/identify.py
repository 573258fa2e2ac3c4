"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_effects_option,
    add_report_option,
    add_row_options,
    report_outputs,
)
from soilml.io.atomic_files import output_files

HELP = "soil parameters from measured rows, by fitting a model"
DESCRIPTION = """\
Identify the soil parameters with which MODEL.toml explains the rows of
RUNS.csv.

  soilml identify MODEL.toml RUNS.csv --out result.json
  soilml identify MODEL.toml RUNS.csv --free cohesion,friction_angle
  soilml identify MODEL.toml RUNS.csv --method linear --where run=sand_3

RUNS.csv has the columns run, slip, load_N, torque_Nm (blank where not
measured) and optionally drawbar_pull_N, sinkage_m and <column>_std. Rows whose
status is not ok are ignored. A channel is used where its noise is declared, in
[noise] or by <column>_std. All rows are assumed to come from one soil, unless
--by run asks for a result for each run. Parameters with a prior are
identified, unless --free names others. Rows of several wheels name theirs,
one of [gears.NAME] in MODEL.toml, in the column gear.

Methods:
  nonlinear  bounded least squares on the full model, from several starts
  linear     cohesion and friction angle from sinkage; shear modulus known
  newton     friction angle, shear modulus and kphi from a closed form;
             cohesion known
  posterior  mean, standard deviation and 90 % interval of the exact posterior
             under the priors and the noise; reports which parameters the rows
             do not determine, and the next measurement that would help most

The result is JSON in SI units, in the file of --out or in a pipe; a terminal
shows a table. --report writes a page to read and print. `posterior/prior`
(remaining_fraction in the file) is the width of the estimate divided by that of the
prior. std is the expected error; it is large where least squares leaves a wide
range open. Read the warnings.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs", type=InputFile, metavar="RUNS.csv", help="measured rows, CSV or Parquet"
    )
    parser.add_argument(
        "--method", default="nonlinear", help="nonlinear (default), linear, newton or posterior"
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="parameters to identify (default: those with a prior)"
    )
    add_effects_option(parser)
    parser.add_argument(
        "--by", metavar="COLUMN", help="one result for each value of this column, such as run"
    )
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.json", help="write the result to this file")
    add_report_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [*output_files(args.out, ".json"), *report_outputs(args)]


def run(args: argparse.Namespace) -> int:
    """Identify and write the result."""
    from soilml.cli.execution.identify import run

    return run(args)
