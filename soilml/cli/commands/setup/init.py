"""`soilml init`: a first model file."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "write a first model file, with comments"
DESCRIPTION = """\
Write a model file to begin with: the wheel, a soil with wide priors, the noise
of the sensors, and the other sections as comments.

  soilml init MODEL.toml                       asks a few questions on a terminal
  soilml init MODEL.toml --radius 0.15 --width 0.12 --soil wong1989/dry_sand
  soilml init MODEL.toml --radius 0.1 --width 0.08 --mass 12 --wheels 4

Without --soil the bearing of the soil is unknown too, and has a prior. With
--mass the file describes a rover on --wheels wheels, whose positions are to be
corrected. An existing file is not replaced.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("out", metavar="MODEL.toml", help="the file to write")
    parser.add_argument("--radius", metavar="M", help="wheel radius in m, or such as '15 cm'")
    parser.add_argument("--width", metavar="M", help="wheel width in m, or such as '120 mm'")
    parser.add_argument(
        "--soil",
        metavar="PAPER/SOIL",
        help="soil whose bearing is known; `soilml soils` lists them",
    )
    parser.add_argument(
        "--torque-noise",
        metavar="NOISE",
        help="standard deviation of torque: '2 %%', 0.05 (N m) or '2 %% + 0.05' (default: 2 %%)",
    )
    parser.add_argument("--mass", metavar="KG", help="mass of a rover in kg")
    parser.add_argument("--wheels", type=int, metavar="N", help="its number of wheels (default: 4)")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [Path(args.out)]


def run(args: argparse.Namespace) -> int:
    """Ask, and write the file."""
    from soilml.cli.execution.setup.init import run

    return run(args)
