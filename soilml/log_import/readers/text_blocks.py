"""Runs that stand one below the other in one text file, each with its own header."""

from __future__ import annotations

import csv
from collections.abc import Sequence

from soilml.log_import.readers.text_layout import TextLayout, is_number, split_line

#: Name of the column that tells the blocks apart.
BLOCK = "block"
#: Fewest samples of a block, and most blocks.
_SHORTEST, _MOST = 20, 1000


def find_blocks(lines: Sequence[str], layout: TextLayout) -> tuple[list[str], list[str]]:
    """The lines of samples (n,) of lines after the first header, and the name of their block (n,).

    A new block begins where the header stands again. The line before it is its name, where these
    lines differ; otherwise blocks are numbered. Names are empty where there is one block.
    """
    samples: list[str] = []
    starts, titles = [0], [layout.about[-1] if layout.about else ""]
    before = ""
    for line in lines:
        if not line or line.isspace():
            continue
        if _is_header(line, layout):
            if len(samples) > starts[-1]:
                starts.append(len(samples))
                titles.append("")
            titles[-1] = before or titles[-1]
            before = ""
            continue
        if _is_title(line, layout):
            before = line.strip().strip(layout.separator + "#%").strip()
            continue
        samples.append(line)
    sizes = [b - a for a, b in zip(starts, [*starts[1:], len(samples)], strict=True)]
    if not 1 < len(sizes) <= _MOST or min(sizes) < _SHORTEST:
        return samples, []
    if len(set(titles)) < len(titles) or not all(titles):
        titles = [f"{i + 1:02d}" for i in range(len(sizes))]
    return samples, [title for title, size in zip(titles, sizes, strict=True) for _ in range(size)]


def _cells(line: str, layout: TextLayout) -> list[str]:
    """The cells of a line; none where it cannot be divided, as damaged samples."""
    try:
        return split_line(line, layout.separator)
    except csv.Error:
        return []


def _is_header(line: str, layout: TextLayout) -> bool:
    """Whether a line has the names of the columns, or their units."""
    first = line.lstrip()[:1]
    if not (first.isalpha() or first in "#%\"'[(" or first == layout.separator):
        return False
    cells = [cell.strip("# %\"'") for cell in _cells(line, layout)]
    known = [cell for cell in cells if cell]
    if len(known) < max(2, len(layout.names) / 2):
        return False
    same = [any(name and cell.startswith(name.split("#")[0]) for name in layout.names)
            for cell in known]  # fmt: skip
    units = [cell.strip("[]()") in layout.units for cell in known]
    return sum(same) > len(known) / 2 or sum(units) > len(known) / 2


def _is_title(line: str, layout: TextLayout) -> bool:
    """Whether a line has one text and no numbers beside it."""
    cells = [cell for cell in _cells(line, layout) if cell]
    return len(cells) == 1 < len(layout.names) and not is_number(cells[0], layout.decimal_comma)
