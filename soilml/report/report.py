"""A result as data: verdict, key figures, tables, pictures and remarks; all forms are made of it.

A room that computes makes one `Report`. Numbers stay numbers in SI units: how they are rounded and
in which units they are shown is decided here, once for terminal, page and notebook.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from soilml.remarks import Remark
from soilml.report.numbers import capitalised, pretty
from soilml.report.tables import ReportTable

MOST_LINES = 5  # Lines below a verdict, at most
MOST_PICTURES = 6  # Pictures of groups on a page
MOST_WARNINGS = 5  # Warnings that a terminal shows without details
TERMINAL_ROWS = 40  # Rows of a table on a terminal without details
MOST_ROWS = 200  # Rows of a table on a page; the JSON file has all


@dataclass(frozen=True)
class Picture:
    """A picture: `draw` fills axes of matplotlib (rows, columns), `size` in inches.

    A page shows each column of axes as an image of its own, so that a phone has them below each
    other, unless the picture is to stay `whole`. `alt` says in words what is seen.
    """

    title: str
    draw: Callable[[Any], object]
    rows: int
    columns: int
    size: tuple[float, float]
    alt: str
    caption: str = ""
    whole: bool = False

    def plot(self, ax: Any = None) -> Any:
        """Draw it into axes of matplotlib, by default those of a new figure; returns the axes.

        They are (rows, columns), or (panels,) where there is one row or one column.
        """
        from soilml.report.figure_style import take_axes

        axes = take_axes(ax, self.rows, self.columns, self.size)
        self.draw(axes)
        return axes.ravel() if 1 in axes.shape else axes

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as a PNG file."""
        from soilml.report.figure_style import save_png

        save_png(self, path)


@dataclass(frozen=True)
class Report:
    """What a result says, in the order of its importance.

    kind: The command that makes it.
    verdict: The answer in at most 25 words.
    lines: At most five sentences below it.
    figures: Key figures: a row for each quantity.
    tables, pictures: Further ones, the first of which matter most.
    remarks: What limits the answer.
    next_steps: What to do, the first step first.
    details: Lists of sentences under headings, for readers who want all; a text of several lines
        is a part of a file, which a page shows as it is.
    status: The answer in a word or two, and its `tone`: good, warn, bad or plain.
    title: What was asked.
    basis: What the answer was made from.
    notation: Terms with their meaning.
    """

    kind: str
    verdict: str
    lines: Sequence[str] = ()
    figures: ReportTable | None = None
    tables: Sequence[ReportTable] = ()
    pictures: Sequence[Picture] = ()
    remarks: Sequence[Remark] = ()
    next_steps: Sequence[str] = ()
    details: Sequence[tuple[str, Sequence[str]]] = ()
    status: str = ""
    tone: str = "plain"
    title: str = ""
    basis: str = ""
    notation: Sequence[tuple[str, str]] = field(default_factory=tuple)

    @property
    def all_tables(self) -> list[ReportTable]:
        """Key figures, where there are any, and the further tables."""
        return [*([] if self.figures is None else [self.figures]), *self.tables]

    def summary(self) -> str:
        """The verdict, then at most five lines: sentences, and key figures where there is room."""
        verdict, *lines = self.answer
        return "\n".join([verdict, *lines[:MOST_LINES]])

    def text(self, details: bool = False) -> str:
        """The report for a terminal: verdict, lines, first table, warnings; all with details."""
        parts = ["\n".join([self.verdict, *self.lines])]
        tables = self.all_tables
        for i, table in enumerate(tables if details else tables[:1]):
            head = f"{capitalised(table.title)}\n" if details or i else ""
            parts.append(head + table.text(most=None if details else TERMINAL_ROWS))
        if details:
            parts += [
                f"{head}\n" + "\n".join(f"- {t}" for t in texts) for head, texts in self.details
            ]
        shown = [r for r in self.remarks if details or r.severity == "warning"]
        kept = shown if details else shown[:MOST_WARNINGS]
        remarks = [f"! {remark.text}" for remark in kept]
        steps = [f"next: {step}" for step in (self.next_steps if details else self.next_steps[:1])]
        left = len(self.remarks) - len(kept)
        more = [f"{left} remark{'s'[: left != 1]}"] if left else []
        more += [f"{n} table{'s'[: n != 1]}"] if not details and (n := len(tables) - 1) > 0 else []
        more += ["details"] if not details and self.details else []
        hint = [f"({', '.join(more)} more: -v)"] if more else []
        for own in (remarks, [*steps, *hint]):
            if own:
                parts.append("\n".join(own))
        return "\n\n".join(parts)

    @property
    def answer(self) -> list[str]:
        """Verdict, lines and key figures as sentences, for programs."""
        figures = self.figures.sentences() if self.figures is not None else []
        return [self.verdict, *self.lines, *figures]

    def _repr_html_(self) -> str:
        """Verdict, lines, key figures or the first table, for notebooks; needs no other library."""
        from html import escape

        lines = "".join(f"<p>{escape(pretty(line))}</p>" for line in self.lines)
        table = ""
        for own in self.all_tables[:1]:
            heads, rows, _ = own.cells()
            head = "".join(f"<th>{escape(pretty(cell))}</th>" for cell in heads)
            body = "".join(
                f"<tr>{''.join(f'<td>{escape(pretty(cell))}</td>' for cell in row)}</tr>"
                for row in rows
            )
            table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"<p><b>{escape(pretty(self.verdict))}</b></p>{lines}{table}"


def by_group(
    reports: Mapping[str, Report], failed: Mapping[str, str], by: str, verdict: str, title: str
) -> Report:
    """The reports of groups of rows as one: a line for each, and their tables joined.

    failed: Why other groups have none. by: What tells the groups apart.
    """
    first = next(iter(reports.values()))
    every: dict[str, dict[str, ReportTable]] = {}
    for name, one in reports.items():
        for table in one.all_tables:
            every.setdefault(table.title, {})[name] = table
    remarks = [r.under(f"{by} {name}: ") for name, one in reports.items() for r in one.remarks]
    remarks += [
        Remark("no-result", f"{by} {name} has no result: {why}", (name,))
        for name, why in failed.items()
    ]
    tones = {one.tone for one in reports.values()}
    return replace(
        first,
        verdict=verdict,
        lines=[f"{by} {n}: {one.verdict}" for n, one in list(reports.items())[:MOST_LINES]],
        figures=None,
        tables=[ReportTable.joined(tables, by) for tables in every.values()],
        pictures=[
            replace(picture, title=f"{by} {name}: {picture.title}")
            for name, one in list(reports.items())[:MOST_PICTURES]
            for picture in one.pictures[:1]
        ],
        remarks=remarks,
        details=(),
        status=f"{len(reports)} results",
        tone=next((tone for tone in ("bad", "warn", "plain", "good") if tone in tones), "plain"),
        title=title,
    )
