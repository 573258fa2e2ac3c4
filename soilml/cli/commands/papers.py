"""`soilml paper numbers`: printed numbers of the source papers beside computed ones."""

from __future__ import annotations

import argparse
import math
import textwrap
from collections import Counter
from typing import TYPE_CHECKING

from soilml.cli.options import OPTIONAL, OutputFile
from soilml.papers.published import PAPERS

if TYPE_CHECKING:
    from soilml.papers.published import Comparison

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Compute the numbers that the source papers print, and compare them.

  soilml paper numbers                  all papers; about ten seconds
  soilml paper numbers nagatani2009     one paper
  soilml paper numbers --summary        how many numbers of each status
  soilml paper numbers comin2017 --all  every number, also those not computed
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
                       under the table
        not_computed   depends on measurements or settings that are not printed
        given          an input or a setting of the experiment; not a result
        wrong          not what its row claims: exit status 1

Only the first says that a model predicts what the authors found. The tolerance
is the largest permitted difference, in the number's unit or in per cent of it.
A number that a paper prints twice, or that follows from another, counts once.
"""
OMITTED = ("given", "not_computed")  # Statuses of rows that --all alone lists
ARGUMENTS = (
    ("paper", f"paper to compute: {', '.join(PAPERS)}", OPTIONAL),
    ("--all", "list every number"),
    ("--summary", "print the counts by status alone"),
    ("--out FILE.csv", "write every number to this file", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Compute, compare and write the table."""
    from soilml.cli.output import write_columns, write_stdout
    from soilml.cli.progress import progress_bar
    from soilml.cli.screen import SCREEN
    from soilml.optional_imports import need
    from soilml.papers.published import count_statuses, printed_numbers

    need("scipy", "paper numbers")
    rows = list(printed_numbers(args.paper))
    found = []
    with progress_bar("computing", len(rows)) as progress:
        for row in rows:
            found.append(row.compare())
            progress(len(found))
    as_text = args.summary or SCREEN.form == "table"
    if args.out is not None or not as_text:
        write_columns(_columns(found), args.out)
    if as_text:
        if args.out is None and not args.summary:
            papers = {c.row.paper: [d for d in found if d.row.paper == c.row.paper] for c in found}
            pages = (_page(paper, its, args.all) for paper, its in papers.items())
            write_stdout("\n\n".join(pages) + "\n\n")
        write_stdout(f"{_summary(found, count_statuses(found))}\n")
    return 1 if any(c.status == "wrong" for c in found) else 0


def _summary(found: list[Comparison], counts: dict[str, dict[str, int]]) -> str:
    """Counts by status and paper, and how many of those reproduced are orders or counts."""
    from soilml.papers.published import ORDINAL, STATUSES
    from soilml.report.aligned_text import format_table

    papers = list(counts) if len(counts) == 1 else [*counts, "all"]
    columns = [Counter(numbers) for numbers in counts.values()]
    columns += [sum(columns, Counter())] * (len(papers) > 1)
    lines = [("all that are printed", *(str(each.total()) for each in columns))]
    for code in next(iter(counts.values())):
        lines.append((STATUSES[code], *(str(each[code]) for each in columns)))
    table = format_table(("status", *papers), lines)
    orders = [
        c.row.unit in ORDINAL for c in found if c.status == "reproduced" and not c.row.counted_with
    ]
    return f"{table}\n" + (
        f"Of those reproduced, {sum(orders)} are an order or a count that a text or a figure "
        f"states, and {len(orders) - sum(orders) or 'none'} a quantity."
        if orders
        else ""
    )


def _page(paper: str, found: list[Comparison], every: bool) -> str:
    """One paper as an aligned table with the reasons under it, then what the table omits."""
    from soilml.report.aligned_text import format_table

    rows = [c for c in found if every or c.status not in OMITTED]
    notes = list(dict.fromkeys(c.row.reason for c in rows if c.row.reason))
    lines = []
    for c in rows:
        row = c.row
        mark = f" [{notes.index(row.reason) + 1}]" if row.reason else ""
        allowed = f"{100 * row.tolerance:.3g} %" if row.relative else f"{row.tolerance:.3g}"
        computed = "" if math.isnan(c.computed) else f"{c.computed:.4g}"
        numbers = (f"{row.published:.4g}", computed, "" if c.status == "not_computed" else allowed)
        lines.append((f"{c.status}{mark}", row.unit, *numbers, f"{row.what} ({row.source})"))
    header = ("status", "unit", "printed", "computed", "tolerance", "what (where)")
    page = [PAPERS[paper], format_table(header, lines, text_columns=2, last_left=True)]
    page += [_wrap(f"[{i}] {note}") for i, note in enumerate(notes, 1)]
    return "\n".join(page + ([] if every else _omitted(found)))


def _omitted(found: list[Comparison]) -> list[str]:
    """What the table omits: inputs, and numbers that are not computed, by reason."""
    inputs = [c.row.what for c in found if c.status == "given"]
    lines = []
    if inputs:
        lines.append(_wrap(f"{len(inputs)} given, kept as printed: {', '.join(inputs)}"))
    why: dict[str, list[str]] = {}
    for c in found:
        if c.status == "not_computed":
            why.setdefault(c.row.reason, []).append(c.row.source)
    for reason, sources in why.items():
        where = "; ".join(dict.fromkeys(sources))
        lines.append(_wrap(f"{len(sources)} not computed ({where}): {reason}"))
    return lines


def _wrap(text: str) -> str:
    from soilml.report.aligned_text import WIDTH

    return textwrap.fill(text, WIDTH, subsequent_indent="    ", break_on_hyphens=False)


def _columns(found: list[Comparison]) -> dict[str, list[object]]:
    of_row = ("paper", "key", "what", "source", "unit", "counted_with", "reason", "published")
    columns = {name: [getattr(c.row, name) for c in found] for name in of_row}
    return columns | {
        "status": [c.status for c in found],
        "computed": [c.computed for c in found],
        "allowed": [c.row.allowed for c in found],
    }
