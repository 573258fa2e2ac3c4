"""Text logs in which the header stands again: a run below each."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.readers.text_layout import TextLayout, cells_of, is_number

BLOCK = "block"  # Name of the column that distinguishes the blocks
_SHORTEST, _MOST = 20, 1000  # Fewest samples of a block, and most blocks


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
            titles[-1], before = before or titles[-1], ""
        elif _is_title(line, layout):
            before = line.strip().strip(layout.separator + "#%").strip()
        else:
            samples.append(line)
    sizes = [b - a for a, b in zip(starts, [*starts[1:], len(samples)], strict=True)]
    if not 1 < len(sizes) <= _MOST or min(sizes) < _SHORTEST:
        return samples, []
    if len(set(titles)) < len(titles) or not all(titles):
        titles = [f"{i + 1:02d}" for i in range(len(sizes))]
    return samples, [title for title, size in zip(titles, sizes, strict=True) for _ in range(size)]


def _is_header(line: str, layout: TextLayout) -> bool:
    """Whether a line has the names of the columns, or their units."""
    first = line.lstrip()[:1]
    if not (first.isalpha() or first in "#%\"'[(" or first == layout.separator):
        return False
    known = [c for cell in cells_of(line, layout.separator) if (c := cell.strip("# %\"'"))]
    if len(known) < max(2, len(layout.names) / 2):
        return False
    starts = tuple(name.split("#")[0] for name in layout.names if name)
    units = sum(cell.strip("[]()") in layout.units for cell in known)
    return max(sum(cell.startswith(starts) for cell in known), units) > len(known) / 2


def _is_title(line: str, layout: TextLayout) -> bool:
    """Whether a line has one text and no numbers beside it."""
    cells = [cell for cell in cells_of(line, layout.separator) if cell]
    return len(cells) == 1 < len(layout.names) and not is_number(cells[0], layout.decimal_comma)
