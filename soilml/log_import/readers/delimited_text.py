"""Text logs: comma, semicolon, tab or space separated, of any encoding."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.bounds import KEPT_VALUES, LOG_BYTES, LOG_VALUES
from soilml.io.csv_by_arrow import blocks_of_cells
from soilml.io.spreadsheet import sheet_rows
from soilml.log_import.readers.text_cells import MISSING, as_numbers, time_of_day
from soilml.log_import.readers.text_layout import TextLayout, decode_text, find_layout, split_line
from soilml.log_import.recording import Recording
from soilml.remarks import Remark

#: Bytes from which a log is read by pyarrow, and by which the layout of such a log is found.
SMALLEST, _HEAD = 1 << 18, 1 << 15
_NUMBERS = 0.5  # Share of the cells of a column that must be numbers
#: Tables of readings, as exports of CAN: most signals, fewest readings of each, and the share of
#: the lines at which the name changes, which runs and states do seldom.
_MOST_SIGNALS, _FEWEST, _CHANGES = 200, 8, 0.2
_UNITS = ("unit", "units", "einheit", "unidad", "unité", "单位")
#: A mark between thousands that is no decimal mark: a hard or thin space, an apostrophe.
_MARKS = "\u00a0\u202f\u2009'\u2019"
_GROUPED = re.compile(rf"(?<=\d)[{_MARKS}](?=\d{{3}}(?!\d))", re.ASCII)


def read_delimited_text(
    path: Path, progress: Callable[[int], None] | None = None
) -> list[Recording]:
    """The table of a text log, or a recording for each signal of one with a line a reading.

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
    said = Remark("encoding", f"read as {encoding}", severity="note")
    notes = [] if encoding in ("utf-8", "utf-8-sig") else [said]
    return _recordings_of(path, text.splitlines(), notes)


def read_spreadsheet_log(path: Path) -> list[Recording]:
    """The table of a sheet (`BOOK.xlsx#SHEET`), whose header and units are found as those of a log.

    Raises `InputError` where the sheet has no samples, and as `sheet_rows` does.
    """
    rows = sheet_rows(path)
    width = max(map(len, rows), default=0)
    # cells hold no tab; a quotation mark, as of inches, must not seem to open a quoted cell
    lines = ["\t".join([*row, *[""] * (width - len(row))]).replace('"', "''") for row in rows]
    return _recordings_of(path, lines, ())


def _recordings_of(path: Path, lines: Sequence[str], found: Sequence[Remark]) -> list[Recording]:
    """The table of lines of text, with what its reader has found; raises as its caller does."""
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
    rows, bad = _rows(lines, layout)
    columns: dict[str, Floats] = {}
    texts: dict[str, list[str]] = {}
    for i, name in enumerate(layout.names):
        cells = [row[i] for row in rows]
        values, numbers = as_numbers(cells, layout.decimal_comma)
        present = sum(cell.strip().lower() not in MISSING for cell in cells)
        if present == 0 or numbers >= _NUMBERS * present:
            columns[name] = values
        else:
            texts[name] = [cell.strip().strip('"') for cell in cells]
    return signals_of(_recorded(path, layout, columns, texts, found, bad))


def _rows(lines: Sequence[str], layout: TextLayout) -> tuple[list[list[str]], int]:
    """The cells of all samples, and how many lines are left out; those of a header are no samples.

    A header may stand again, above each run.
    """
    width, bad = len(layout.names), 0
    rows: list[list[str]] = []
    above, samples = {*lines[: layout.first]}, lines[layout.first :]
    simple = layout.separator != " " and '"' not in "".join(samples[:50])
    for line in samples:
        if not line.strip() or line in above:
            continue
        try:
            cells = line.split(layout.separator) if simple else split_line(line, layout.separator)
        except csv.Error:
            cells = []
        short = len(cells) < max(2, width / 2) < width
        if short or any(cell.strip() for cell in cells[width:]):
            bad += 1
        else:
            rows.append((cells + [""] * (width - len(cells)))[:width])
    return rows, bad


def _recorded(
    path: Path,
    layout: TextLayout,
    columns: dict[str, Floats],
    texts: dict[str, list[str]],
    found: Iterable[Remark],
    bad: int,
) -> Recording:
    """The recording of a text log, texts of times as seconds; `bad` lines are left out."""
    said = list(found)
    if layout.decimal_comma:
        said.append(Remark("decimal-comma", "numbers have decimal commas", severity="note"))
    if bad:
        text = f"{bad} lines have a wrong number of cells and are left out"
        said.append(Remark("lines-left-out", text))
    times = {name: time_of_day(cells) for name, cells in texts.items()}
    columns |= {name: seconds for name, seconds in times.items() if seconds is not None}
    columns = {name: columns[name] for name in layout.names if name in columns}
    texts = {name: cells for name, cells in texts.items() if times[name] is None}
    units = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
    return Recording("", path, columns, texts, units, about=layout.about, notes=tuple(said))


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
    rows, bad = _rows(lines, layout)
    if bad or not rows:
        return None
    of_text = []
    for name, cells in zip(layout.names, zip(*rows, strict=True), strict=True):
        present = sum(cell.strip().lower() not in MISSING for cell in cells)
        if as_numbers(cells, layout.decimal_comma)[1] < _NUMBERS * present:
            of_text.append(name)
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
                opened, layout.names, of_text, layout.names, progress, missing=[*missing],
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
    whole = {name: np.concatenate(parts) for name, parts in found.items()}
    texts = {name: [cell.strip() for cell in whole.pop(name)] for name in of_text}
    columns = {name: cells.astype(np.float64) for name, cells in whole.items()}
    return _recorded(path, layout, columns, texts, notes, bad)


def signals_of(recording: Recording) -> list[Recording]:
    """A recording for each signal of a table of readings; the table itself where it is none.

    Such a table has a text that changes from line to line, one column of numbers beside the time,
    and perhaps the unit as text.
    """
    texts = recording.texts
    signals = [n for n in texts if n.lower() not in _UNITS and _is_signal(texts[n])]
    numbers = [name for name, own in recording.columns.items() if np.isfinite(own).any()]
    clocks = [name for name in numbers if _rises(recording, name)]
    if not signals or len(numbers) != 2 or len(clocks) != 1:
        return [recording]
    signal, (clock,) = max(signals, key=lambda n: len({*texts[n]})), clocks
    (value,) = (name for name in numbers if name != clock)
    of_unit = next((name for name in texts if name.lower() in _UNITS), "")
    said = Remark("long-table", f"each line is one reading of {signal!r}", (signal,), "note")
    cells, known = np.asarray(texts[signal]), np.isfinite(recording.columns[clock])
    found = []
    for name in dict.fromkeys(texts[signal]):
        own = recording.rows((cells == name) & known)
        columns = {clock: own.columns[clock], name: own.columns[value]}
        units = {clock: recording.units.get(clock, "")}
        units[name] = own.texts[of_unit][0] if of_unit else ""
        notes = (*recording.notes, said)
        found.append(Recording("", own.file, columns, {}, units, about=own.about, notes=notes))
    return found


def _is_signal(cells: list[str]) -> bool:
    """Whether a text (n,) is a few names that take turns."""
    counts = Counter(cells)
    if not 1 < len(counts) <= _MOST_SIGNALS or min(counts.values()) < _FEWEST or "" in counts:
        return False
    return sum(a != b for a, b in pairwise(cells)) > _CHANGES * len(cells)


def _rises(recording: Recording, name: str) -> bool:
    values = recording.columns[name]
    values = values[np.isfinite(values)]
    # compared, not subtracted: differences of huge numbers overflow
    return values.size > 1 and bool(np.all(values[1:] >= values[:-1])) and values[-1] > values[0]
