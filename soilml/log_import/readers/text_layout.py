"""The layout of a text log: encoding, separator, header, units, where samples begin."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from soilml.errors import InputError
from soilml.io.bounds import COLUMNS
from soilml.io.cell_text import read_number
from soilml.log_import.readers.text_cells import is_number
from soilml.log_import.units import known_unit

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
#: Bytes above ASCII in a row, and the share of those in pairs or more that says Chinese.
_HIGH, _PAIRED = re.compile(rb"[\x80-\xff]+"), 0.8
COMMENTS = ("#", "%", "//", ";;")
_BRACKETS = re.compile(r"^(.*?)\s*[\[(<{]\s*([^\])>}]*)\s*[\])>}]\s*$")
#: A quantity over its unit, as `Zeit / s` and `T in N m`.
_OVER_UNIT = re.compile(r"^(.+?\w)\s+(?:/|in)\s+(\S.{0,15})$")
#: The same without spaces, of a name of some length: `torque/mNm`, `rate/(deg/s)`.
_OVER_UNIT_CLOSE = re.compile(r"^([^\W\d_]{3,}[^/()\[\],\s]*)/(\([^)]*\)|[^/ ]{1,8})$")
#: What divides the words in brackets; words before a unit.
_PARTS = re.compile(r"\s+[-:\u2013]\s+|[,;]")
_IN = re.compile(r"^(?:(.*)\s)?in\s+(\S.*)$")
#: Words that are no unit.
_WORDS = re.compile(r"[^\W\d_]{4,}(?:[ _-].*)?|.*[ _-][^\W\d_]{4,}")
#: A name with its unit in brackets, or a word.
_NAMED = re.compile(r"[^\s\[(]+\s*(?:\[[^\]]*\]|\([^)]*\))?")
#: What stands before units in a line of comment.
_UNITS_FOLLOW = re.compile(r"^(units?|einheit(en)?|unidades|unités?)\s*[:=]\s*", re.IGNORECASE)
_SEPARATORS = (";", "\t", ",", "|")
#: Lines looked at, and how many of them must follow each other like samples.
_LOOKED, _IN_A_ROW = 400, 3
#: Files that a program writes without a header: name of the file -> columns with their units.
#: DBP.dat is of the drawbar-pull rig in Chrono::Vehicle's co-simulation (OutputData of
#: ChVehicleCosimWheeledMBSNode.cpp), whose slip is 1 - v/(r omega).
_HEADERS: dict[str, tuple[tuple[str, str], ...]] = {
    "DBP.dat": (
        ("time", "s"), ("lin_vel", "m/s"), ("ang_vel", "rad/s"), ("slip", "1"),
        ("slip_filtered", "1"), ("DBP", "N"), ("DBP_filtered", ""),
    ),
}  # fmt: skip


def decode_text(data: bytes, file: Path) -> tuple[str, str]:
    """The text and its encoding: UTF-8, UTF-16 with its mark, GB 18030 or Windows-1252.

    Raises `InputError` for a file that is not text.
    """
    for mark, name in _MARKS:
        if data.startswith(mark):
            return data.decode(name, errors="replace"), name
    if b"\0" in data[:4096]:
        raise InputError(
            f"{file} is not a text file, and its name has no ending of another format; known are "
            ".csv, .txt, .tsv, .dat, .json, .parquet, .mat, .h5, .mcap and .bag"
        )
    # letters with accents stand alone among ASCII, Chinese characters are two bytes each
    runs = [len(run) for run in _HIGH.findall(data)]
    chinese = sum(size for size in runs if size >= 2) > _PAIRED * sum(runs)
    for name in ("utf-8", *(["gb18030"] if chinese else [])):
        with suppress(UnicodeDecodeError):
            return data.decode(name), name
    return data.decode("cp1252", errors="replace"), "cp1252"


@dataclass(frozen=True)
class TextLayout:
    """How a text log is written.

    separator: One character; " " for any white space.
    decimal_comma: Numbers are written as 0,25.
    names, units: Header and units, one for each column; units are "" where not stated.
    first: Index of the first line of samples.
    about: Lines before the header.
    """

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    first: int
    about: tuple[str, ...]


def find_layout(file: Path, lines: Sequence[str]) -> TextLayout | None:
    """The layout of the lines of a text file; None where nothing in it looks like samples.

    Raises `InputError` for more columns than a log may have, before any cell is looked at;
    `csv.Error`, with the line, for a line before the samples that has no cells.
    """
    head = list(lines[:_LOOKED])
    for line in head:
        COLUMNS.check(file, max(len(line.split()), *(line.count(s) + 1 for s in _SEPARATORS)))
    text = "".join(head)
    possible = [s for s in _SEPARATORS if text.count(s) >= _IN_A_ROW]
    found = [(s, d, *_samples(head, s, d)) for s in (*possible, " ") for d in (False, True)]
    # a comma cannot separate cells and be the decimal mark
    found = [f for f in found if f[3] > 0 and not (f[0] == "," and f[1])]
    if not found:
        return None
    best = max(found, key=lambda f: (f[3] * min(f[4], 3), f[4], _numbers(head[f[2] :], f[0], f[1])))
    separator, comma, first, _, width = best
    names, units, header = _header(head[:first], separator, width)
    known = _HEADERS.get(file.name, ())
    if header == first and len(known) == width:  # a file without a header
        names, units = zip(*known, strict=True)
    about = tuple(plain for line in head[:header] if (plain := _uncommented(line)))
    return _with_labview_head(TextLayout(separator, comma, names, units, first, about))


def _with_labview_head(layout: TextLayout) -> TextLayout:
    """The layout with the units, and the rate where there is no clock, of the head of a .lvm file.

    Of signals with one clock, or none: the first column is `X_Value`, the last one `Comment`.
    """
    said = {}
    for line in layout.about:
        key, *cells = (cell.strip() for cell in line.split(layout.separator))
        said[key] = [cell for cell in cells if cell]
    if not {"Writer_Version", "Multi_Headings"} <= said.keys():
        return layout
    labels = said.get("Y_Unit_Label", [])
    signals = [n for n in layout.names if not n.startswith(("X_Value", "Comment"))]
    own = dict(zip(signals, labels, strict=True)) if len(labels) == len(signals) else {}
    own |= {"X_Value": "s"} if said.get("X_Dimension") == ["Time"] else {}
    own = {name: unit for name, unit in own.items() if known_unit(unit)}
    units = [u or own.get(n, "") for n, u in zip(layout.names, layout.units, strict=True)]
    about = layout.about
    with suppress(ValueError, IndexError):
        step = read_number(said.get("Delta_X", ["0"])[0].replace(",", "."))
        if said.get("X_Columns") == ["No"] and step > 0.0:
            about = (*about, f"rate: {1.0 / step:g} Hz")
    return replace(layout, units=tuple(units), about=about)


def split_line(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and white space around them."""
    if separator == " ":
        return line.split()
    cells = next(csv.reader([line], delimiter=separator), [])
    return [cell.strip() for cell in cells]


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line; none where it cannot be divided, as damaged samples."""
    try:
        return split_line(line, separator)
    except csv.Error:
        return []


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name and unit of a header such as `Fz [N]` or `speed (mm/s)`; the unit is "" without one."""
    for pattern in (_OVER_UNIT, _OVER_UNIT_CLOSE):
        if (match := pattern.match(cell)) and known_unit(unit := match[2].strip("[](){} ")):
            return match[1].strip(), unit
    match = _BRACKETS.match(cell)
    if match and match[1].strip():
        return _unit_and_remark(match[1].strip(), match[2].strip())
    for mark in (",", " - "):
        name, there, unit = (part.strip() for part in cell.rpartition(mark))
        short = mark == "," and 0 < len(unit) <= 3
        if there and name and (short or known_unit(unit)):
            return name, unit
    return cell.strip(), ""


def _unit_and_remark(name: str, said: str) -> tuple[str, str]:
    """Name and unit of what stands in brackets, as `before gearbox - degrees`.

    Words there that are no unit are part of the name.
    """
    if (match := _IN.match(said)) and known_unit(match[2]):
        return f"{name} {match[1] or ''}".strip(), match[2]
    if known_unit(said):
        return name, said
    parts = [part.strip() for part in _PARTS.split(said) if part.strip()]
    units = [part for part in parts if known_unit(part)]
    if len(parts) > 1 and len(units) == 1:
        rest = " ".join(part for part in parts if part != units[0])
        return f"{name} {rest}", units[0]
    return (f"{name} {said}", "") if _WORDS.fullmatch(said) else (name, said)


def _samples(head: list[str], separator: str, comma: bool) -> tuple[int, int, int]:
    """Index of the first sample, how many lines look like it, and their number of cells."""
    kinds: list[int] = []
    for line in head:
        cells = [] if line.lstrip().startswith(COMMENTS) else cells_of(line, separator)
        numbers = sum(bool(c) and is_number(c, comma) for c in cells)
        # names of runs and times of day stand beside the numbers
        kinds.append(len(cells) if numbers >= max(1, sum(map(bool, cells)) / 2) else 0)
    widths = Counter(k for k in kinds if k)
    if not widths:
        return 0, 0, 0
    width = max(widths, key=lambda w: (widths[w], w))
    like = [abs(k - width) <= width // 4 and k > 0 for k in kinds]
    for i in range(len(like)):
        if all(like[i : i + _IN_A_ROW]):
            return i, sum(like[i:]), max(k for k, fits in zip(kinds, like, strict=True) if fits)
    return 0, 0, 0


def _numbers(lines: list[str], separator: str, comma: bool) -> int:
    """How many cells are numbers: of two decimal marks, that of a few columns decides."""
    cells = (cell for line in lines for cell in cells_of(line, separator) if cell)
    return sum(is_number(cell, comma) for cell in cells)


def _header(
    head: list[str], separator: str, width: int
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names, units and the index of the header line, among the lines before the samples."""
    rows, said = [], None
    for i, line in enumerate(head):
        text = _uncommented(line)
        try:
            cells = _header_cells(_UNITS_FOLLOW.sub("", text), separator, width)
        except csv.Error as error:
            raise csv.Error(f"line {i + 1}: {error}") from None
        while cells and not cells[-1] and len(cells) > width:
            cells.pop()
        if _UNITS_FOLLOW.match(text) and len(cells) == width:
            said = cells  # whatever its place
            continue
        # some loggers end each line of samples with a separator, and the header without
        if abs(len(cells) - width) <= max(1, width // 8) and sum(map(bool, cells)) > width / 2:
            rows.append((i, cells))
    rows = [row for row in rows if row[0] >= len(head) - 5]
    if not rows:
        return tuple(f"column_{i + 1}" for i in range(width)), ("",) * width, len(head)
    index, names_row = rows[0]
    for later, cells in rows[1:]:
        if _are_units(cells):
            break
        index, names_row = later, cells
    units_rows = [cells for i, cells in rows if i > index and _are_units(cells)]
    units = (said or (units_rows[0] if units_rows else [])) + [""] * width
    names: list[str] = []
    stated: list[str] = []
    for k in range(width):
        cell = names_row[k] if k < len(names_row) else ""
        name, unit = name_and_unit(cell) if cell else (f"column_{k + 1}", "")
        if name in names:
            name = f"{name}#{names.count(name) + 1 + sum(n.startswith(name + '#') for n in names)}"
        names.append(name)
        stated.append(units[k].strip("[](){} ") or unit)
    return tuple(names), tuple(stated), index


def _header_cells(text: str, separator: str, width: int) -> list[str]:
    """The cells of a line before the samples; names may have another separator than the samples."""
    cells = split_line(text, separator)
    if len(cells) > width:
        cells = _closed(cells, separator, width)
    if separator == " " and len(cells) != width:
        for own in (re.split(r"\s{2,}", text), _NAMED.findall(text)):
            if len(own) == width and not any(is_number(cell) for cell in own):
                return own
    for other in _SEPARATORS if separator == " " or len(cells) < width else ():
        own = split_line(text, other)
        if len(own) == width and not any(is_number(cell) for cell in own):
            return own
    return cells


def _closed(cells: list[str], separator: str, width: int) -> list[str]:
    """The cells of a header whose brackets hold a separator, as `speed (rpm, before gearbox)`.

    The cells as they are, where that does not give the width of the samples.
    """
    found: list[str] = []
    for cell in cells:
        if found and found[-1].count("(") > found[-1].count(")"):
            found[-1] = f"{found[-1]}{separator} {cell}"
        else:
            found.append(cell)
    return found if len(found) == width else cells


def _are_units(cells: list[str]) -> bool:
    """Whether the cells of a line below the header look like units."""
    texts = [cell.strip("[](){} ") for cell in cells]
    texts = [text for text in texts if text not in ("", "-")]
    return bool(texts) and sum(known_unit(text) for text in texts) > len(texts) / 2


def _uncommented(line: str) -> str:
    text = line.strip()
    for mark in COMMENTS:
        text = text.removeprefix(mark).strip()
    return text
