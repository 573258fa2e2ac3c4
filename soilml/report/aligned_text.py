"""Aligned tables and broken lines, as a terminal shows them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

WIDTH = 80  # Characters of a line
_LEAST_WRAPPED = 14  # Fewest characters to which a column is wrapped


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
