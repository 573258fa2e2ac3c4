"""`soilml papers`: every printed number of the source papers compared with the computed one."""

from __future__ import annotations

import argparse
import math
import textwrap
from collections import Counter
from typing import TYPE_CHECKING

from soilml.cli.options import add_output
from soilml.papers.published import PAPERS

if TYPE_CHECKING:
    from soilml.papers.published import Comparison

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
WIDTH = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paper", nargs="?", help=f"paper to compute: {', '.join(PAPERS)}")
    parser.add_argument("--all", action="store_true", help="list every number")
    add_output(parser, "--out", "FILE.csv", "write the table to this file")


def run(args: argparse.Namespace) -> int:
    """Compute, compare and write the table."""
    from soilml.cli.output import is_terminal, tell, write_columns
    from soilml.cli.progress import progress_bar
    from soilml.optional_imports import need
    from soilml.papers.published import printed_numbers

    need("scipy", "papers")
    rows = list(printed_numbers(args.paper))
    found = []
    with progress_bar("computing", len(rows)) as progress:
        for row in rows:
            found.append(row.compare())
            progress(len(found))
    if args.out is not None or not is_terminal():
        write_columns(_columns(found), args.out)
    else:
        papers = {c.row.paper: [d for d in found if d.row.paper == c.row.paper] for c in found}
        print("\n\n".join(_page(paper, its, args.all) for paper, its in papers.items()), end="\n\n")
    count = Counter(c.verdict for c in found)
    tell(
        f"{len(found)} printed numbers: {count['yes']} reproduced within their tolerance, "
        f"{count['known']} known to miss it, {count['NO']} wrong; {count['given']} inputs kept as "
        f"printed; {count['not computed']} not computed"
    )
    return 1 if count["NO"] else 0


def _page(paper: str, found: list[Comparison], every: bool) -> str:
    """One paper as an aligned table with the reasons under it, then what the table omits."""
    from soilml.io.text_tables import format_table

    rows = [c for c in found if every or c.verdict in ("yes", "known", "NO")]
    notes = list(dict.fromkeys(c.row.reason for c in rows if c.row.reason))
    lines = []
    for c in rows:
        row = c.row
        mark = f" [{notes.index(row.reason) + 1}]" if row.reason else ""
        allowed = f"{100 * row.tolerance:.3g} %" if row.relative else f"{row.tolerance:.3g}"
        computed = "" if math.isnan(c.computed) else f"{c.computed:.4g}"
        numbers = (f"{row.published:.4g}", computed, "" if c.verdict == "not computed" else allowed)
        lines.append((f"{c.verdict}{mark}", row.unit, *numbers, f"{row.what} ({row.source})"))
    header = ("holds", "unit", "printed", "computed", "tolerance", "what (where)")
    page = [PAPERS[paper].title, format_table(header, lines, text_columns=2, last_left=True)]
    page += [_wrap(f"[{i}] {note}") for i, note in enumerate(notes, 1)]
    return "\n".join(page + ([] if every else _omitted(found)))


def _omitted(found: list[Comparison]) -> list[str]:
    """What the table omits: inputs, and numbers that are not computed, by reason."""
    inputs = [c.row.what for c in found if c.verdict == "given"]
    lines = []
    if inputs:
        lines.append(_wrap(f"{len(inputs)} given, kept as printed: {', '.join(inputs)}"))
    why: dict[str, list[str]] = {}
    for c in found:
        if c.verdict == "not computed":
            why.setdefault(c.row.reason, []).append(c.row.source)
    for reason, sources in why.items():
        where = "; ".join(dict.fromkeys(sources))
        lines.append(_wrap(f"{len(sources)} not computed ({where}): {reason}"))
    return lines


def _wrap(text: str) -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent="    ", break_on_hyphens=False)


def _columns(found: list[Comparison]) -> dict[str, list[object]]:
    return {
        "paper": [c.row.paper for c in found],
        "key": [c.row.key for c in found],
        "what": [c.row.what for c in found],
        "source": [c.row.source for c in found],
        "unit": [c.row.unit for c in found],
        "holds": [c.verdict for c in found],
        "reason": [c.row.reason for c in found],
        "published": [c.row.published for c in found],
        "computed": [c.computed for c in found],
        "allowed": [c.row.allowed for c in found],
    }
