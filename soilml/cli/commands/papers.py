"""`soilml papers`: every printed number of the source papers compared with the computed one."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.io.atomic_files import output_files
from soilml.papers.catalogue import PAPERS

HELP = "printed numbers of the source papers next to the computed ones"
DESCRIPTION = """\
Compute the numbers that the source papers print, and compare them.

  soilml papers                        all papers; takes about ten seconds
  soilml papers nagatani2009           one paper
  soilml papers comin2017 --all        every number, also those not computed
  soilml papers --out papers.csv       every number, as CSV

holds: yes           computed; the difference is within the tolerance
       known         computed; the difference is larger, for a known reason
                     that is given under the table
       NO            computed; the difference is larger without a known reason:
                     exit status 1
       given         an input, which the model keeps as printed; not a result
       not computed  depends on measurements or settings that are not printed;
                     the reason is given

The tolerance is the largest permitted difference, in the number's unit or in
per cent of the number.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paper", nargs="?", help=f"paper to compute: {', '.join(PAPERS)}")
    parser.add_argument("--all", action="store_true", help="list every number")
    parser.add_argument("--out", metavar="FILE.csv", help="write the table to this file")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return output_files(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Compute, compare and write the table."""
    from soilml.cli.execution.papers import run

    return run(args)
