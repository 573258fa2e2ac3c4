"""The one reader of numbers that are written as text: cells, options and settings in quotes.

Python's own `float` also takes underscores, digits of other scripts, "nan" and "infinity": a cell
`1_000`, damaged from `1.000`, would be read as a thousand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

_CHARACTERS = frozenset("0123456789+-.eE")
#: Digits of a whole number; more do not fit into 64 bits.
_MOST_DIGITS = 18


def read_number(text: str) -> float:
    """A finite decimal number such as 12, -0.5 or 1e-3; raises `ValueError` for anything else."""
    if not _CHARACTERS.issuperset(text):
        raise ValueError(f"{text!r} is not a number")
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{text!r} is not a finite number")
    return value


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
