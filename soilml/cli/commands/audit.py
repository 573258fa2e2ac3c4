"""`soilml audit`: effects that a rig and an experimental design could identify."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import (
    InputFile,
    add_cost_option,
    add_effects_option,
    add_ignore_extra_option,
)
from soilml.io.atomic_files import output_files

HELP = "missing effects that planned runs could identify"
DESCRIPTION = """\
Determine which missing effects the planned runs of DESIGN.csv could identify
with the sensors of MODEL.toml, which they could not, and which run to add. No
measurement is needed.

  soilml audit MODEL.toml DESIGN.csv
  soilml audit MODEL.toml DESIGN.csv --out audit.json

DESIGN.csv has the columns run, slip, load_N, and speed_m_s, pass,
slip_angle_rad where they are set. Channels are those whose noise is declared
in [noise].

In the table, `left` is the signal of an effect of its reference size in
standard deviations of the noise (sigma) after the free soil parameters have
absorbed what they can, and `apart` is the part of it that its most similar
rival cannot explain: an effect can be named from about 3. `detectable` is the
smallest size that is noticed in four of five data sets. With --cost, runs to
add are ranked by the effects that they gain per cost.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", type=InputFile, metavar="MODEL.toml", help="gear, soil and noise")
    parser.add_argument(
        "design", type=InputFile, metavar="DESIGN.csv", help="planned rows, CSV or Parquet"
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="soil parameters to fit (default: those with a prior)"
    )
    parser.add_argument("--out", metavar="FILE.json", help="write the audit to this file")
    add_cost_option(parser)
    add_ignore_extra_option(parser)
    add_effects_option(parser)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".json")


def run(args: argparse.Namespace) -> int:
    """Audit and print or write."""
    from soilml.cli.execution.audit import run

    return run(args)
