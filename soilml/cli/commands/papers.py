"""`soilml paper numbers`: printed numbers of the source papers beside computed ones."""

from __future__ import annotations

import argparse

from soilml.cli.options import OPTIONAL, OutputFile
from soilml.papers.published import PAPERS

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Compute the numbers that the source papers print, and compare them.

  soilml paper numbers                  how many numbers of each status
  soilml paper numbers nagatani2009     the numbers of one paper
  soilml paper numbers -v               all of them, with reasons
  soilml paper numbers --out papers.csv every number, as CSV

status: reproduced     computed without the number, within the tolerance
        recovered      the number, or what it follows from, was put into a
                       simulation and found again
        arithmetic     follows from other printed numbers
        depends        an order or a count that another choice of what is not
                       printed turns round
        tuned          agrees because an input that is not printed was chosen
                       so, or only for that choice of it
        missed         computed; the difference is larger, for the reason given
        not_computed   depends on measurements or settings that are not printed
        given          an input or a setting of the experiment; not a result
        wrong          not what its row claims: exit status 1

Only the first says that a model predicts what the authors found. The tolerance
is the largest permitted difference, in the number's unit or in per cent of it.
A number that a paper prints twice, or that follows from another, counts once.
"""
ARGUMENTS = (
    ("paper", f"paper to compute: {', '.join(PAPERS)}", OPTIONAL),
    ("--out FILE.csv", "write every number to this file", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Compute, compare and write the table."""
    from soilml.cli.output import deliver
    from soilml.cli.progress import progress_bar
    from soilml.optional_imports import need
    from soilml.papers.published import printed_numbers
    from soilml.papers.report import number_columns, number_report

    need("scipy", "paper numbers")
    rows = list(printed_numbers(args.paper))
    found = []
    with progress_bar("computing", len(rows)) as progress:
        for row in rows:
            found.append(row.compare())
            progress(len(found))
    deliver(args, number_report(found), columns=number_columns(found))
    return 1 if any(c.status == "wrong" for c in found) else 0
