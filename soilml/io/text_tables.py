"""Writing tables: CSV files and aligned text."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from soilml.io.cell_text import text_as_cell

Columns = Mapping[str, Sequence[Any] | np.ndarray[Any, Any]]

BLOCK = 8192  # Rows that are formatted at a time
WIDTH = 100  # Characters of a line of an aligned table
_LEAST_WRAPPED = 16  # Fewest characters to which a column is wrapped


def wrapped(text: str) -> str:
    """The text with its longer lines broken between words; what follows a break is indented."""
    return "\n".join(
        line
        if len(line) <= WIDTH
        else textwrap.fill(
            line, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
        for line in text.split("\n")
    )


def csv_text(columns: Columns) -> str:
    """The columns as CSV; NaN becomes a blank cell, numbers keep ten digits."""
    return "".join(csv_blocks(columns))


def csv_blocks(columns: Columns) -> Iterator[str]:
    """The text of `csv_text` in blocks of rows, so that a long table is never held as text."""
    yield _csv([list(columns)])
    rows = {len(values) for values in columns.values()}
    if len(rows) > 1:
        raise ValueError(f"columns of {sorted(rows)} rows are not one table")
    for start in range(0, max(rows, default=0), BLOCK):
        cells = [
            [_cell(value) for value in values[start : start + BLOCK]] for values in columns.values()
        ]
        yield _csv(zip(*cells, strict=True))


def _csv(rows: Any) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.10g}"
    return text_as_cell(value) if isinstance(value, str) else str(value)


def format_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    text_columns: int = 1,
    last_left: bool = False,
    width: int = WIDTH,
) -> str:
    """An aligned table: text (the first columns, or the last) to the left, numbers to the right.

    A last column of text is wrapped, so that the lines have at most `width` characters.
    """
    table = [list(header), *[list(row) for row in rows]]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    left = {*range(text_columns), *([len(header) - 1] if last_left else [])}
    before = sum(widths[:-1]) + 2 * (len(widths) - 1)
    if len(header) - 1 in left and before + widths[-1] > width:
        widths[-1] = min(widths[-1], max(width - before, _LEAST_WRAPPED))
    lines = []
    for row in table:
        first, *more = textwrap.wrap(row[-1], widths[-1]) or [""]
        cells = [
            cell.ljust(width) if i in left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip([*row[:-1], first], widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
        lines += [" " * before + text for text in more]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join(lines)
