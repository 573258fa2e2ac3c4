"""The report of printed numbers beside computed ones, and their columns."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from soilml.papers.published import ORDINAL, PAPERS, Comparison, count_statuses
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable

OMITTED = ("given", "not_computed")  # Statuses of rows that the file alone lists


def number_columns(found: Sequence[Comparison]) -> dict[str, list[Any]]:
    """A row for each printed number, by names of columns."""
    of_row = ("paper", "key", "what", "source", "unit", "counted_with", "reason", "published")
    columns = {name: [getattr(c.row, name) for c in found] for name in of_row}
    return columns | {
        "status": [c.status for c in found],
        "computed": [c.computed for c in found],
        "allowed": [c.row.allowed for c in found],
    }


def number_report(found: Sequence[Comparison]) -> Report:
    """Counts by status and paper, the numbers of each paper, and why some are no result.

    Of one paper the numbers come first.
    """
    counted = [c for c in found if not c.row.counted_with]
    reproduced = [c.row.unit in ORDINAL for c in counted if c.status == "reproduced"]
    wrong = [c.row for c in found if c.status == "wrong"]
    verdict = f"{len(reproduced)} of {len(counted)} printed numbers are reproduced independently."
    if wrong:
        verdict = f"{len(wrong)} numbers are not what their rows claim, first {wrong[0].key}."
    quantities = len(reproduced) - sum(reproduced)
    orders = (
        f"Of those reproduced, {sum(reproduced)} are an order or a count that a text or a figure "
        f"states, and {quantities or 'none'} a quantity."
    )
    papers = {c.row.paper: [d for d in found if d.row.paper == c.row.paper] for c in found}
    tables = [_numbers(PAPERS[paper], own) for paper, own in papers.items()]
    return Report(
        kind="paper-numbers",
        verdict=verdict,
        lines=[orders] if reproduced else [],
        tables=[*tables, _counts(found)] if len(tables) == 1 else [_counts(found), *tables],
        details=[(PAPERS[paper], list(_reasons(own))) for paper, own in papers.items()],
        status="wrong" if wrong else "as claimed",
        tone="bad" if wrong else "good",
        title="Printed numbers of the source papers",
    )


def _counts(found: Sequence[Comparison]) -> ReportTable:
    """Numbers by status, a column for each paper and one for all of several."""
    counts = {paper: Counter(own) for paper, own in count_statuses(found).items()}
    if len(counts) > 1:
        counts["all"] = sum(counts.values(), Counter())
    codes = list(next(iter(count_statuses(found).values())))
    words = Column("status", ["printed", *(code.replace("_", " ") for code in codes)])
    return ReportTable(
        "Numbers by status",
        [
            words,
            *(
                Column(paper, [own.total(), *(own[code] for code in codes)])
                for paper, own in counts.items()
            ),
        ],
    )


def _numbers(title: str, found: Sequence[Comparison]) -> ReportTable:
    """The computed numbers of one paper beside the printed ones."""
    rows = [c for c in found if c.status not in OMITTED]
    tolerances = [
        f"{100 * c.row.tolerance:.3g} %" if c.row.relative else f"{c.row.tolerance:.3g}"
        for c in rows
    ]
    cells = {
        "status": [c.status for c in rows],
        "unit": [c.row.unit for c in rows],
        "printed": [f"{c.row.published:.4g}" for c in rows],
        "computed": ["" if math.isnan(c.computed) else f"{c.computed:.4g}" for c in rows],
        "tolerance": tolerances,
        "what (where)": [f"{c.row.what} ({c.row.source})" for c in rows],
    }
    return ReportTable(title, [Column(heading, own) for heading, own in cells.items()])


def _reasons(found: Sequence[Comparison]) -> Iterator[str]:
    """Why numbers are no result of a model: each reason with the numbers that it is of."""
    given = [c.row.what for c in found if c.status == "given"]
    if given:
        yield f"{len(given)} given, kept as printed: {', '.join(given)}"
    why: dict[tuple[str, str], list[str]] = {}
    for c in found:
        if c.row.reason and c.status != "given":
            why.setdefault((c.status, c.row.reason), []).append(c.row.source)
    for (status, reason), sources in why.items():
        where = "; ".join(dict.fromkeys(sources))
        yield f"{len(sources)} {status.replace('_', ' ')} ({where}): {reason}"
