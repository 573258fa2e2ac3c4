"""`soilml soils`: the catalogue of published soils."""

from __future__ import annotations

import argparse

HELP = "list the published soils, or show one with its source"
DESCRIPTION = """\
List the catalogue of published soils. Values are in SI units; * marks a value
that is not printed in the paper and is assumed.

  soilml soils                      all soils, one line each
  soilml soils wong1989/dry_sand    one soil, with its source and every value
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("name", nargs="?", help="PAPER/SOIL, the name of the soil to show")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or one entry."""
    from soilml.cli.execution.soils import run

    return run(args)
