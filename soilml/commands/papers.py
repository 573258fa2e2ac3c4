"""`soilml papers`: every printed number of the source papers beside the computed one."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from soilml.commands.output import deliver, watched
from soilml.needs import need
from soilml.papers import PAPERS, TITLES
from soilml.papers.published import Compared, published
from soilml.saving import named
from soilml.writing import aligned

HELP = "the source papers' printed numbers beside the computed ones"
DESCRIPTION = """\
Compute every number that the source papers print, and show it beside what they print.

  soilml papers                        all; takes about a minute
  soilml papers nagatani2009           one paper
  soilml papers --out papers.csv       for programs

`holds` says whether the difference is within the tolerance. What is known not to be reproduced, or
cannot be, is in the table as well, and the reason stands under it. Exit status 1 where a number
that should hold does not.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paper", nargs="?", help=f"one of: {', '.join(PAPERS)}")
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the table")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".csv")


def run(args: argparse.Namespace) -> int:
    """Compute and deliver the table."""
    need("scipy", "papers")
    rows = list(published(args.paper))
    found = []
    for i, row in enumerate(rows):
        if sys.stderr.isatty():
            print(
                f"\r\033[K{i + 1}/{len(rows)} {row.what[:60]}", end="", file=sys.stderr, flush=True
            )
        found.append(row.compared())
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)
    if args.out is not None or not watched():
        deliver(_columns(found), args.out)
    else:
        print("\n\n".join(_page(paper, found) for paper in PAPERS if _of(paper, found)))
    held, known = sum(c.holds for c in found), sum(c.said == "known" for c in found)
    wrong = [c for c in found if c.said == "NO"]
    print(
        f"{held} of {len(found)} printed numbers reproduced within their tolerance, {known} known "
        f"not to be, {len(wrong)} wrong",
        file=sys.stderr,
    )
    return 1 if wrong else 0


def _of(paper: str, found: list[Compared]) -> list[Compared]:
    return [c for c in found if c.row.paper == paper]


def _page(paper: str, found: list[Compared]) -> str:
    """One paper as an aligned table, with the reasons under it."""
    header = ("what", "where", "unit", "holds", "printed", "computed", "tolerance")
    lines, notes = [], []
    for c in _of(paper, found):
        mark = ""
        if c.row.reason:
            if c.row.reason not in notes:
                notes.append(c.row.reason)
            mark = f" [{notes.index(c.row.reason) + 1}]"
        allowed = f"{100 * c.row.tolerance:.3g} %" if c.row.relative else f"{c.row.tolerance:.3g}"
        computed = "" if math.isnan(c.computed) else f"{c.computed:.4g}"
        numbers = (f"{c.row.published:.4g}", computed, allowed)
        lines.append((c.row.what, c.row.source, c.row.unit, f"{c.said}{mark}", *numbers))
    said = [f"[{i}] {note}" for i, note in enumerate(notes, 1)]
    return "\n".join([TITLES[paper], aligned(header, lines, text_columns=4), *said])


def _columns(found: list[Compared]) -> dict[str, list[object]]:
    return {
        "paper": [c.row.paper for c in found],
        "key": [c.row.key for c in found],
        "what": [c.row.what for c in found],
        "source": [c.row.source for c in found],
        "unit": [c.row.unit for c in found],
        "holds": [c.said for c in found],
        "reason": [c.row.reason for c in found],
        "published": [c.row.published for c in found],
        "computed": [c.computed for c in found],
        "allowed": [c.row.allowed for c in found],
    }
