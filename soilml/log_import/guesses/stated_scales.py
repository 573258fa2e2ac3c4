"""Calibrations of sensors that a log states in its head: `1 mV = 0.425 N m`, `12.5 N/V`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from soilml.log_import.guesses.columns.column_words import name_scores, words_of
from soilml.log_import.units.conversion import dimension
from soilml.log_import.units.unit_names import is_raw_signal, spelling

_NUMBER = r"([+-]?[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?)"
_RAW = r"([munµμ]?V(?:/V)?|volts?|digits?|counts?|lsb)\b"
_UNIT = r"([A-Za-zµ·*][A-Za-zµ·* ²^0-9-]*)"
_LAZY = r"([A-Za-zµ·*][A-Za-zµ·* ²^0-9-]*?)"
#: 1 mV = 0.425 N m; 2 mV/V at 50 N m.
_EQUAL = re.compile(
    rf"{_NUMBER}\s*{_RAW}\s*(?:=|≙|->|:|corresponds? to|equals?|at|for|entspr\w*)\s*"
    rf"{_NUMBER}\s*{_UNIT}",
    re.IGNORECASE,
)
#: 0.425 N m/mV; 0.425 Nm per mV.
_RATIO = re.compile(rf"{_NUMBER}\s*{_LAZY}\s*(?:/|\bper\b|\bpro\b)\s*{_RAW}", re.IGNORECASE)


def stated_scale(
    name: str, unit: str, role: str, ours: str, lines: Sequence[str]
) -> tuple[str, str]:
    """What 1 in a column of this raw unit is, as a value of a map, and the line that states it.

    Of several lines whose unit fits, that which has words of the column, or of its role. Two empty
    texts where no line fits.
    """
    found: list[tuple[int, str, str]] = []
    for line in lines:
        value = _in_line(line, unit, ours)
        if value:
            common = {*words_of(name)} & {*words_of(line)}
            found.append((2 * (role in name_scores(line)) + len(common), value, line))
    if not found:
        return "", ""
    best = max(found, key=lambda f: f[0])
    # two calibrations of which none is said to be of this column
    if best[0] == 0 and len({value for _, value, _ in found}) > 1:
        return "", ""
    return best[1], best[2]


def _in_line(line: str, unit: str, ours: str) -> str:
    for match in _EQUAL.finditer(line):
        raw, one, number, text = match[2], _float(match[1]), _float(match[3]), match[4]
        if (ratio := _ratio(raw, unit)) and one and (known := _longest_unit(text, ours)):
            return f"{number / one / ratio:.6g} {known}"
    for match in _RATIO.finditer(line):
        if (ratio := _ratio(match[3], unit)) and dimension(match[2].strip()) == ours:
            return f"{_float(match[1]) / ratio:.6g} {match[2].strip()}"
    return ""


def _ratio(stated: str, unit: str) -> float:
    """How many units of the column the stated one is; 0 where they are of different kinds."""
    if not (is_raw_signal(stated) and is_raw_signal(unit)):
        return 0.0
    a, b = spelling(stated), spelling(unit)
    if a == b:
        return 1.0
    size = {"uV": 1e-6, "mV": 1e-3, "V": 1.0, "kV": 1e3}
    return size[a] / size[b] if {a, b} <= size.keys() else 0.0


def _longest_unit(text: str, ours: str) -> str:
    """The longest beginning of a text, word by word, that is a unit of this kind; "" for none."""
    words = text.strip().split(" ")
    for count in range(len(words), 0, -1):
        start = " ".join(words[:count]).strip(" .-")
        kind = dimension(start)
        if start and (kind == ours or (kind == "kg" and ours == "N")):
            return {"kg": "kgf", "g": "gf"}.get(start, start) if kind == "kg" else start
    return ""


def _float(text: str) -> float:
    return float(text.replace(",", "."))
