"""Text from files that is printed or written: no terminal commands, no spreadsheet formulas."""

from __future__ import annotations

import unicodedata

#: Unicode categories that a terminal may obey or that reorder what is read: control, format,
#: surrogate, private use, not assigned; and separators of lines and paragraphs.
_NOT_PLAIN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
#: First characters of a cell that spreadsheet programs calculate.
_FORMULA = ("=", "+", "-", "@")


def is_plain(text: str) -> bool:
    """Whether every character of the text is shown as itself."""
    return text.isprintable() or all(unicodedata.category(c) not in _NOT_PLAIN for c in text)


def escaped(text: str) -> str:
    r"""The text with escapes such as \x1b for characters that are not plain; newlines stay."""
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or is_plain(c) else ascii(c)[1:-1] for c in text)


def text_as_cell(text: str) -> str:
    """A text as the cell of a CSV file; one that a spreadsheet would calculate gets a quote."""
    return f"'{text}" if text.startswith(_FORMULA) else text


def cell_as_text(cell: str) -> str:
    """The text of a cell that `text_as_cell` may have written."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell
