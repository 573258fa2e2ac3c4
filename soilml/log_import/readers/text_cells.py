"""Cells of text logs: numbers with any decimal mark and thousands, dates and times of day."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence

import numpy as np

from soilml.arrays import Floats
from soilml.io.cell_text import read_number, read_numbers

#: Cells that stand for a missing number.
MISSING = {
    "", "nan", "na", "n/a", "null", "none", "-", "--", "---", "#n/a", "inf", "-inf", "+inf",
    "nan(ind)", "-nan(ind)", "-nan", "1.#qnan", "-1.#ind", "missing", "?", "overflow",
}  # fmt: skip
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?", re.ASCII)
_WITH_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eEdD][+-]?\d+)?", re.ASCII)
#: Numbers with a mark between thousands, by that mark.
_THOUSANDS = {
    ",": re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", re.ASCII),
    ".": re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?", re.ASCII),
    " ": re.compile(r"[+-]?[1-9]\d{0,2}( \d{3})+([.,]\d*)?", re.ASCII),
}
_CLOCK = re.compile(r"(\d{1,3}):(\d{2}):(\d{2}(?:[.,]\d*)?)(?:\s*([AaPp][Mm]))?", re.ASCII)
_DATES = ("%d-%m-%Y %H:%M:%S.%f", "%d-%m-%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S")


def is_number(cell: str, decimal_comma: bool = False) -> bool:
    """Whether a cell is a number, or stands for a missing one.

    Thousands count where they cannot be taken for decimals: with both marks, or two groups.
    """
    text = cell.strip()
    if text.lower() in MISSING or _PLAIN.fullmatch(text):
        return True
    if _THOUSANDS[" "].fullmatch(text) and "," * decimal_comma in text:
        return True
    if decimal_comma and _WITH_COMMA.fullmatch(text):
        return True
    mark, other = ".,"[not decimal_comma], ",."[not decimal_comma]
    return bool(_THOUSANDS[mark].fullmatch(text)) and (other in text or text.count(mark) > 1)


def as_numbers(cells: Sequence[str], decimal_comma: bool = False) -> tuple[Floats, int]:
    """The cells as numbers, NaN where they are none, and how many are numbers."""
    plain = [cell.strip() for cell in _without_thousands(cells, decimal_comma)]
    if decimal_comma:
        plain = [cell.replace(",", ".") for cell in plain]
    try:
        values = np.array(read_numbers(plain), dtype=np.float64)
    except ValueError:
        values = np.array([_number(cell) for cell in plain], dtype=np.float64)
    return values, int(np.isfinite(values).sum())


def _without_thousands(cells: Sequence[str], decimal_comma: bool) -> Sequence[str]:
    """The cells with 12,345.6 (or 12.345,6, 12 345.6) as 12345.6, where all marks are of a kind."""
    spaced = _THOUSANDS[" "].fullmatch
    if any(spaced(cell.strip()) for cell in cells):
        cells = [cell.replace(" ", "") if spaced(cell.strip()) else cell for cell in cells]
    mark = "." if decimal_comma else ","
    marked = [cell.strip().strip('"') for cell in cells if mark in cell]
    if not marked or not all(map(_THOUSANDS[mark].fullmatch, marked)):
        return cells
    return [cell.replace(mark, "").strip('"') for cell in cells]


def _number(cell: str) -> float:
    try:
        return read_number(cell.strip('"').strip().replace("d", "e").replace("D", "e"))
    except ValueError:
        return float("nan")


def time_of_day(cells: Sequence[str]) -> Floats | None:
    """Dates and times of day as seconds; None for other text. Midnight is passed once a day."""
    own = [cell.strip().strip('"') for cell in cells]
    shown = [cell for cell in own if cell][:20]
    parsers: tuple[Callable[[str], float], ...] = (_iso_seconds, _clock_seconds)
    for parse in parsers:
        if shown and all(np.isfinite(parse(cell)) for cell in shown):
            values = np.array([parse(cell) for cell in own], dtype=np.float64)
            if parse is _clock_seconds:
                known = np.flatnonzero(np.isfinite(values))
                days = np.cumsum(np.diff(values[known], prepend=values[known[0]]) < -43200.0)
                values[known] += 86400.0 * days
            return values
    return None


def _iso_seconds(cell: str) -> float:
    text = cell.replace("Z", "+00:00").replace("/", "-")
    if match := re.fullmatch(r"(.*\.\d{6})\d+(.*)", text):
        text = match[1] + match[2]  # nanoseconds
    if not text.isascii():
        return float("nan")
    iso = len(text) >= 10 and text[:4].isdigit()
    for form in ("",) if iso else _DATES:
        try:
            if iso:
                when = datetime.datetime.fromisoformat(text)
            else:
                when = datetime.datetime.strptime(text.replace(",", "."), form)
        except ValueError:
            continue
        return (when if when.tzinfo else when.replace(tzinfo=datetime.UTC)).timestamp()
    return float("nan")


def _clock_seconds(cell: str) -> float:
    match = _CLOCK.fullmatch(cell)
    if match is None:
        return float("nan")
    hours = int(match[1])
    if match[4]:
        hours = hours % 12 + (12 if match[4].lower() == "pm" else 0)
    return 3600.0 * hours + 60.0 * int(match[2]) + float(match[3].replace(",", "."))
