"""Text logs: comma, semicolon, tab or space separated, of any encoding."""

from __future__ import annotations

import csv
import datetime
import re
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.bounds import KEPT_VALUES, LOG_BYTES, LOG_VALUES
from soilml.io.cell_text import read_number, read_numbers
from soilml.io.csv_by_arrow import blocks_of_cells
from soilml.io.spreadsheet import sheet_rows
from soilml.log_import.readers.blocks_of_text import BLOCK, find_blocks
from soilml.log_import.readers.text_layout import (
    MISSING,
    TextLayout,
    decode_text,
    find_layout,
    split_line,
)
from soilml.log_import.recording import Recording
from soilml.remarks import Remark

#: Bytes from which a log is read by pyarrow, and by which the layout of such a log is found.
SMALLEST, _HEAD = 1 << 18, 1 << 15
_NUMBERS = 0.5  # Share of the cells of a column that must be numbers
_COMMAS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", re.ASCII)
_DOTS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?", re.ASCII)
#: A mark between thousands that is no decimal mark: a hard or thin space, an apostrophe.
_MARKS = "\u00a0\u202f\u2009'\u2019"
_GROUPED = re.compile(rf"(?<=\d)[{_MARKS}](?=\d{{3}}(?!\d))", re.ASCII)
_SPACED = re.compile(r"[+-]?[1-9]\d{0,2}( \d{3})+([.,]\d*)?", re.ASCII)
_CLOCK = re.compile(r"(\d{1,3}):(\d{2}):(\d{2}(?:[.,]\d*)?)(?:\s*([AaPp][Mm]))?", re.ASCII)
_DATES = ("%d-%m-%Y %H:%M:%S.%f", "%d-%m-%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S")
_MOST, _FEWEST = 200, 8  # Most signals, and fewest readings of each
_CHANGES = 0.2  # Share of the lines at which the name changes; runs and states change seldom


def read_delimited_text(
    path: Path, progress: Callable[[int], None] | None = None
) -> list[Recording]:
    """The table of a text log.

    Encoding, separator, decimal mark, header, line of units and the first sample are found. Cells
    that are not a number count as missing. Lines with a wrong number of cells are left out.

    progress: Called with the number of bytes read.

    Raises `InputError` where the file has no samples, or is long and not plain.
    """
    size = path.stat().st_size
    if size >= SMALLEST and (plain := _plain_recording(path, progress)) is not None:
        return signals_of(plain)
    LOG_BYTES.check(path, size)
    text, encoding = decode_text(path.read_bytes(), path)
    if any(mark in text for mark in _MARKS):
        text = _GROUPED.sub("", text)
    notes = []
    if encoding not in ("utf-8", "utf-8-sig"):
        notes.append(Remark("encoding", f"read as {encoding}", severity="note"))
    return recordings_of(path, text.splitlines(), notes)


def read_spreadsheet_log(path: Path) -> list[Recording]:
    """The table of a sheet (`BOOK.xlsx#SHEET`), whose header and units are found as those of a log.

    Raises `InputError` where the sheet has no samples, and as `sheet_rows` does.
    """
    rows = sheet_rows(path)
    width = max(map(len, rows), default=0)
    # cells hold no tab; a quotation mark, as of inches, must not seem to open a quoted cell
    lines = ["\t".join([*row, *[""] * (width - len(row))]).replace('"', "''") for row in rows]
    return recordings_of(path, lines, ())


def _plain_recording(path: Path, progress: Callable[[int], None] | None) -> Recording | None:
    """A long log of plain cells, by pyarrow in blocks; None for one that has to be read by lines.

    It has to where a cell is no number, as in a second header. Of a log that holds more values than
    memory has room for, one sample in some is read, evenly over the whole.
    """
    with path.open("rb") as opened:
        data = opened.read(_HEAD).rpartition(b"\n")[0]
    if b'"' in data or data.count(b"\r") > data.count(b"\r\n"):
        return None
    try:
        lines = data.decode("utf-8-sig").splitlines()
        layout = find_layout(path, lines)
    except (UnicodeDecodeError, csv.Error):
        return None
    if layout is None or layout.separator == " ":
        return None
    samples, blocks = find_blocks(lines[layout.first :], layout)
    rows, bad = _rows(samples, layout)
    if bad or blocks or not rows:
        return None
    texts = _columns([row for row, _ in rows], layout, as_time=False)[1].keys()
    start = sum(len(line) for line in data.splitlines(keepends=True)[: layout.first])
    usual = (len(data) - start) / len(rows)  # bytes of a line
    every = max(1, -int(-(path.stat().st_size - start) / usual * len(layout.names) // KEPT_VALUES))
    found: dict[str, list[Any]] = {name: [] for name in layout.names}

    def skipped(row: Any) -> str:
        nonlocal bad
        bad += 1
        return "skip" if every > 1 else "error"

    missing = {form for cell in MISSING for form in (cell, cell.upper(), cell.title(), "NaN")}
    try:
        with path.open("rb") as opened:
            opened.seek(start)
            decimal = "," if layout.decimal_comma else "."
            first = 0
            for batch in blocks_of_cells(
                opened, layout.names, texts, layout.names, progress, missing=[*missing],
                separator=layout.separator, decimal=decimal, bad_line=skipped,
                skip_empty=True,
            ):  # fmt: skip
                for name in layout.names:
                    cells = batch.column(name).to_numpy(zero_copy_only=False)
                    found[name].append(cells[first::every].copy())  # else a view keeps all
                first = (first - len(batch)) % every
    except (ImportError, ValueError):  # pyarrow's own errors are kinds of `ValueError`
        return None
    said = f"it is long: one sample in {every} is read, evenly over the whole"
    notes = [Remark("thinned", said)] if every > 1 else []
    columns, kept = {}, {}
    for name, parts in found.items():
        joined = np.concatenate(parts)
        own = [cell.strip() for cell in joined] if name in texts else []
        seconds = time_of_day(own) if own else joined.astype(np.float64)
        if seconds is not None:
            columns[name] = seconds
        else:
            kept[name] = own
    return _recorded(path, layout, columns, kept, notes, bad)


def _recorded(
    path: Path,
    layout: TextLayout,
    columns: dict[str, Floats],
    texts: dict[str, list[str]],
    notes: Sequence[Remark],
    bad: int,
) -> Recording:
    """The recording of a text log, with what its layout says; `bad` lines are left out."""
    said = list(notes)
    if layout.decimal_comma:
        said.append(Remark("decimal-comma", "numbers have decimal commas", severity="note"))
    if bad:
        text = f"{bad} lines have a wrong number of cells and are left out"
        said.append(Remark("lines-left-out", text))
    units = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
    return Recording("", path, columns, texts, units, about=layout.about, notes=tuple(said))


def recordings_of(path: Path, lines: Sequence[str], found: Sequence[Remark]) -> list[Recording]:
    """The table of lines of text, with what its reader has found; raises as its caller does."""
    notes = list(found)
    try:
        layout = find_layout(path, lines)
    except csv.Error as error:
        raise InputError(
            f"{path} {error}; needed is a table, with the names of its columns above the samples"
        ) from None
    if layout is None:
        raise InputError(
            f"{path}: no line of this file looks like samples; needed is a table of numbers, one "
            "sample a line, separated by comma, semicolon, tab or spaces"
        )
    LOG_VALUES.check(path, len(lines) * len(layout.names))
    samples, blocks = find_blocks(lines[layout.first :], layout)
    rows, bad = _rows(samples, layout)
    columns, texts = _columns([row for row, _ in rows], layout)
    if blocks:
        said = f"the header stands {len(set(blocks))} times: a run below each ({BLOCK!r})"
        notes.append(Remark("blocks", said, (BLOCK,), "note"))
        texts[BLOCK] = [blocks[i] for _, i in rows]
    return signals_of(_recorded(path, layout, columns, texts, notes, bad))


def _rows(lines: list[str], layout: TextLayout) -> tuple[list[tuple[list[str], int]], int]:
    """The cells of all samples with the index of their line, and how many lines are left out."""
    width, bad = len(layout.names), 0
    rows: list[tuple[list[str], int]] = []
    simple = layout.separator != " " and '"' not in "".join(lines[:50])
    for i, line in enumerate(lines):
        try:
            cells = line.split(layout.separator) if simple else split_line(line, layout.separator)
        except csv.Error:
            cells = []
        short = len(cells) < max(2, width / 2) < width
        if short or any(cell.strip() for cell in cells[width:]):
            bad += 1
        else:
            rows.append(((cells + [""] * (width - len(cells)))[:width], i))
    return rows, bad


def _columns(
    rows: list[list[str]], layout: TextLayout, as_time: bool = True
) -> tuple[dict[str, Floats], dict[str, list[str]]]:
    columns: dict[str, Floats] = {}
    texts: dict[str, list[str]] = {}
    for i, name in enumerate(layout.names):
        cells = [row[i] for row in rows]
        values, numbers = as_numbers(cells, layout.decimal_comma)
        present = sum(cell.strip().lower() not in MISSING for cell in cells)
        if present == 0 or numbers >= _NUMBERS * present:
            columns[name] = values
        elif as_time and (seconds := time_of_day(cells)) is not None:
            columns[name] = seconds
        else:
            texts[name] = [cell.strip().strip('"') for cell in cells]
    return columns, texts


def as_numbers(cells: list[str], decimal_comma: bool = False) -> tuple[Floats, int]:
    """The cells as numbers, NaN where they are none, and how many are numbers."""
    cells = without_thousands(cells, decimal_comma)
    if decimal_comma:
        cells = [cell.replace(",", ".") for cell in cells]
    cells = [cell.strip() for cell in cells]
    try:
        values = np.array(read_numbers(cells), dtype=np.float64)
    except ValueError:
        values = np.array([_number(cell) for cell in cells], dtype=np.float64)
    return values, int(np.isfinite(values).sum())


def without_thousands(cells: list[str], decimal_comma: bool) -> list[str]:
    """The cells with 12,345.6 (or 12.345,6, 12 345.6) as 12345.6, where all marks are of a kind."""
    if any(_SPACED.fullmatch(cell.strip()) for cell in cells):
        cells = [cell.replace(" ", "") if _SPACED.fullmatch(cell.strip()) else cell
                 for cell in cells]  # fmt: skip
    mark, pattern = (".", _DOTS) if decimal_comma else (",", _COMMAS)
    marked = [cell for cell in cells if mark in cell]
    if not marked or not all(pattern.fullmatch(cell.strip().strip('"')) for cell in marked):
        return cells
    return [cell.replace(mark, "").strip('"') for cell in cells]


def _number(cell: str) -> float:
    try:
        return read_number(cell.strip('"').strip().replace("d", "e").replace("D", "e"))
    except ValueError:
        return float("nan")


def time_of_day(cells: list[str]) -> Floats | None:
    """Dates and times of day as seconds; None for other text. Midnight is passed once a day."""
    own = [cell.strip().strip('"') for cell in cells]
    shown = [cell for cell in own if cell][:20]
    for parse in (_iso_seconds, _clock_seconds):
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


def signals_of(recording: Recording) -> list[Recording]:
    """A recording for each signal of a table of readings; the table itself where it is none.

    Such a table has a text that changes from line to line, one column of numbers beside the time,
    and perhaps the unit as text.
    """
    numbers = [name for name, values in recording.columns.items() if np.isfinite(values).any()]
    clocks = [name for name in numbers if _rises(recording, name)]
    values = [name for name in numbers if name not in clocks]
    signals = [name for name, cells in recording.texts.items() if _is_signal(cells)]
    if len(clocks) != 1 or len(values) != 1 or not signals:
        return [recording]
    # a unit has fewer different texts than the signals, or as many and shorter ones
    texts = recording.texts
    signal = max(signals, key=lambda n: (len(set(texts[n])), sum(map(len, set(texts[n])))))
    units = next((name for name in texts if name != signal and name.lower() in ("unit", "units",
                  "einheit", "unidad", "unité", "单位")), "")  # fmt: skip
    cells, clock = np.asarray(recording.texts[signal]), clocks[0]
    found = []
    for name in dict.fromkeys(recording.texts[signal]):
        keep = (cells == name) & np.isfinite(recording.columns[clock])
        own = recording.rows(keep)
        unit = {clock: recording.units[clock]} if clock in recording.units else {}
        if units:
            unit[name] = own.texts[units][0]
        columns = {clock: own.columns[clock], name: own.columns[values[0]]}
        said = f"each line is one reading of {signal!r}"
        notes = (*recording.notes, Remark("long-table", said, (signal,), "note"))
        found.append(
            Recording("", recording.file, columns, {}, unit, about=recording.about, notes=notes)
        )
    return found


def _is_signal(cells: list[str]) -> bool:
    counts = Counter(cells)
    if not 1 < len(counts) <= _MOST or min(counts.values()) < _FEWEST or "" in counts:
        return False
    changes = sum(a != b for a, b in pairwise(cells))
    return changes > _CHANGES * len(cells)


def _rises(recording: Recording, name: str) -> bool:
    values = recording.columns[name]
    values = values[np.isfinite(values)]
    # compared, not subtracted: differences of huge numbers overflow
    return values.size > 1 and bool(np.all(values[1:] >= values[:-1])) and values[-1] > values[0]
