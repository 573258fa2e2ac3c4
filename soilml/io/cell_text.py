"""Text of cells, options and settings: numbers, plain text, no spreadsheet formulas.

Python's own `float` also takes underscores, digits of other scripts, "nan" and "infinity": a cell
`1_000`, damaged from `1.000`, would be read as a thousand.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence

_CHARACTERS = frozenset("0123456789+-.eE")
_MOST_DIGITS = 18  # Digits of a whole number; more do not fit into 64 bits
#: Unicode categories that a terminal may obey or that reorder what is read: control, format,
#: surrogate, private use, not assigned; and separators of lines and paragraphs.
_NOT_PLAIN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
_FORMULA = ("=", "+", "-", "@")  # First characters of a cell that spreadsheet programs calculate


def read_number(text: str) -> float:
    """A finite decimal number such as 12, -0.5 or 1e-3; raises `ValueError` for anything else."""
    if not _CHARACTERS.issuperset(text):
        raise ValueError(f"{text!r} is not a number")
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{text!r} is not a finite number")
    return value


def is_number(text: str) -> bool:
    """Whether a text is a number as `read_number` takes it."""
    try:
        read_number(text)
    except ValueError:
        return False
    return True


def read_numbers(texts: Sequence[str]) -> list[float]:
    """What `read_number` gives for each text, in a fifth of the time; raises as it does."""
    if not _CHARACTERS.issuperset("".join(texts)):
        raise ValueError("one of the texts is not a number")
    values = list(map(float, texts))
    if math.inf in values or -math.inf in values:
        raise ValueError("one of the texts is not a finite number")
    return values


def read_whole_number(text: str) -> int:
    """A whole number of at most 18 digits; raises `ValueError` for anything else."""
    digits = text.removeprefix("-")
    if not (digits.isascii() and digits.isdecimal() and len(digits) <= _MOST_DIGITS):
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)


def is_plain(text: str) -> bool:
    """Whether every character of the text is shown as itself."""
    return text.isprintable() or all(unicodedata.category(c) not in _NOT_PLAIN for c in text)


def escaped(text: str) -> str:
    r"""The text with escapes such as \x1b for characters that are not plain; newlines stay."""
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or is_plain(c) else ascii(c)[1:-1] for c in text)


def one_line(text: object) -> str:
    """The text with escapes for newlines too, as a name stands in a message."""
    return escaped(str(text)).replace("\n", "\\n")


def text_as_cell(text: str) -> str:
    """A text as the cell of a CSV file; one that a spreadsheet would calculate gets a quote."""
    return f"'{text}" if text.startswith(_FORMULA) else text


def cell_as_text(cell: str) -> str:
    """The text of a cell that `text_as_cell` may have written."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell
