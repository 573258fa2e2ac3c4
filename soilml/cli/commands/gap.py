"""`soilml gap`: where a model and measurements disagree, and what the model lacks."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_cost_option,
    add_effects_option,
    add_ignore_extra_option,
    add_seed_option,
    folder_outputs,
)
from soilml.cli.output_names import GAP_FILES, GAP_SUSPECTED

HELP = "find where a model and measured runs disagree, and name the missing effect"
DESCRIPTION = """\
Compare MODEL.toml with measured runs. Where they disagree by more than noise
and run-to-run scatter, search for the missing effect, name it if the data
distinguish it from all others, add it to the model, and report how much of the
gap it closes.

  soilml gap MODEL.toml RUNS.csv --out DIR
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout run
  soilml gap MODEL.toml RUNS.csv --out DIR --holdout load_N=150

--holdout keeps a quarter of the runs, or the rows with this value, for
validation. All rows of a run must come from one soil bed; one load per run is
best. Soil parameters without a prior are fixed at the model's values, and an
error in them appears as an effect.

RUNS.csv has the columns run, slip, load_N, torque_Nm, and optionally
drawbar_pull_N, sinkage_m, speed_m_s (below zero in reverse), pass,
slip_angle_rad, time_s and <column>_std. DIR receives report.html (start here),
gap.json, model.toml (the model with the effects that the evidence supports) and
next_runs.csv (runs to measure next); and model_suspected.toml where causes are
suspected but not named. The exit status is 0 whatever the result and 2 for bad
input.

Runs of several wheels on one soil: write each as [gears.NAME] in MODEL.toml,
and name it in the column gear. An effect of one wheel is then grousers@NAME.

--checked torque-gain=0.003 declares the standard deviation of a sensor's fault
after calibration, in the unit that `soilml effects` lists. --cost second-pass=3
gives the cost of a kind of run in next_runs.csv, in any unit; runs are then
ranked by what they discriminate per cost.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs", type=InputFile, metavar="RUNS.csv", help="measured rows, CSV or Parquet"
    )
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for the four files")
    parser.add_argument(
        "--holdout",
        metavar="COLUMN=VALUE",
        help="rows held out for validation, or `run` for a quarter of the runs",
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="soil parameters to fit (default: those with a prior)"
    )
    add_seed_option(parser)
    parser.add_argument(
        "--checked",
        metavar="EFFECT=STD",
        action="append",
        default=[],
        help="standard deviation of a sensor's fault after calibration; can be repeated",
    )
    add_cost_option(parser)
    add_ignore_extra_option(parser)
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where their folder exists already."""
    return folder_outputs("--out", args.out, (*GAP_FILES, GAP_SUSPECTED))


def run(args: argparse.Namespace) -> int:
    """Analyse and write the four files."""
    from soilml.cli.execution.gap import run

    return run(args)
