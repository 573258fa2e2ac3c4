"""`soilml paper numbers`: printed numbers of the source papers beside computed ones."""

from __future__ import annotations

import argparse
import math
import textwrap
from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.options import add_output
from soilml.papers.published import PAPERS

if TYPE_CHECKING:
    from soilml.papers.published import Comparison
    from soilml.report.page import Content

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Compute the numbers that the source papers print, and compare them.

  soilml paper numbers                        all papers; takes about forty seconds
  soilml paper numbers nagatani2009           one paper
  soilml paper numbers --summary              how many numbers of each status
  soilml paper numbers comin2017 --all        every number, also those not computed
  soilml paper numbers --out papers.csv       every number, as CSV
  soilml paper numbers --out papers.json     the same with the summary, as JSON

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
        own_check      not printed: a check of this package
        wrong          not what its row claims: exit status 1

Only the first says that a model predicts what the authors found. The tolerance
is the largest permitted difference, in the number's unit or in per cent of it.
A number that a paper prints twice, or that follows from another, counts once.
"""
WIDTH = 100
OMITTED = ("given", "not_computed")  # Statuses of rows that --all alone lists


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("paper", nargs="?", help=f"paper to compute: {', '.join(PAPERS)}")
    parser.add_argument("--all", action="store_true", help="list every number")
    parser.add_argument("--summary", action="store_true", help="print the counts by status alone")
    add_output(parser, "--out", "FILE.csv", "write numbers to this file, or FILE.json", ".json")


def run(args: argparse.Namespace) -> int:
    """Compute, compare and write the table."""
    from soilml.cli.options import is_json
    from soilml.cli.output import save_columns, tell, tell_columns, write_stdout
    from soilml.cli.progress import progress_bar
    from soilml.cli.screen import SCREEN
    from soilml.io.atomic_files import write_files
    from soilml.optional_imports import need
    from soilml.papers.published import count_statuses, printed_numbers
    from soilml.report.page import json_text

    need("scipy", "paper numbers")
    rows = list(printed_numbers(args.paper))
    found = []
    with progress_bar("computing", len(rows)) as progress:
        for row in rows:
            found.append(row.compare())
            progress(len(found))
    counts, columns = count_statuses(found), _columns(found)
    files: dict[Path, Content] = {}
    if args.out is not None:
        text = json_text(_as_json(found, counts)) if is_json(args) else None
        files[Path(args.out)] = partial(save_columns, columns) if text is None else text
    write_files(files)
    as_text = SCREEN.form_of_rows() == "table"
    if args.out is not None or not (args.summary or as_text):
        tell_columns(columns, args.out)
    elif not args.summary and as_text:
        papers = {c.row.paper: [d for d in found if d.row.paper == c.row.paper] for c in found}
        write_stdout("\n\n".join(_page(p, its, args.all) for p, its in papers.items()) + "\n\n")
    if args.summary or as_text:
        write_stdout(f"{_summary(found, counts)}\n")
    tell(_said(counts))
    return 1 if any(c.status == "wrong" for c in found) else 0


def _said(counts: dict[str, dict[str, int]]) -> str:
    """The counts of all papers in a line."""
    total = {
        code: sum(each[code] for each in counts.values()) for code in next(iter(counts.values()))
    }
    printed = sum(n for code, n in total.items() if code != "own_check")
    return f"{printed} printed numbers: " + ", ".join(f"{n} {code}" for code, n in total.items())


def _summary(found: list[Comparison], counts: dict[str, dict[str, int]]) -> str:
    """Counts by status and paper, and how many of those reproduced are orders or counts."""
    from soilml.papers.published import ORDINAL, STATUSES
    from soilml.report.aligned_text import format_table

    papers = list(counts) if len(counts) == 1 else [*counts, "all"]
    columns = [Counter(numbers) for numbers in counts.values()]
    columns += [sum(columns, Counter())] * (len(papers) > 1)
    printed = [str(each.total() - each["own_check"]) for each in columns]
    lines = [("all that are printed", *printed)]
    for code in next(iter(counts.values())):
        lines.append((STATUSES[code], *(str(each[code]) for each in columns)))
    table = format_table(("status", *papers), lines)
    orders = [
        c.row.unit in ORDINAL for c in found if c.status == "reproduced" and not c.row.counted_with
    ]
    if not orders:
        return table
    return f"{table}\n" + _wrap(
        f"Of those reproduced, {sum(orders)} are an order or a count that a text or a figure "
        f"states, and {len(orders) - sum(orders) or 'none'} a quantity."
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
    page = [PAPERS[paper].title, format_table(header, lines, text_columns=2, last_left=True)]
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
    return textwrap.fill(text, WIDTH, subsequent_indent="    ", break_on_hyphens=False)


def _columns(found: list[Comparison]) -> dict[str, list[object]]:
    return {
        "paper": [c.row.paper for c in found],
        "key": [c.row.key for c in found],
        "what": [c.row.what for c in found],
        "source": [c.row.source for c in found],
        "unit": [c.row.unit for c in found],
        "status": [c.status for c in found],
        "counted_with": [c.row.counted_with for c in found],
        "reason": [c.row.reason for c in found],
        "published": [c.row.published for c in found],
        "computed": [c.computed for c in found],
        "allowed": [c.row.allowed for c in found],
    }


def _as_json(found: list[Comparison], counts: dict[str, dict[str, int]]) -> dict[str, Any]:
    """Counts by paper and status, and the numbers with the columns of the CSV file as keys."""
    columns = _columns(found)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return {"counts": counts, "numbers": rows}
