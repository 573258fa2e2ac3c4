"""CSV files and sheets as columns, in blocks of rows; errors name file, line and column."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import dropwhile, islice
from pathlib import Path
from typing import Any, TextIO, cast

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.bounds import COLUMNS, ROWS, TEXT_BYTES
from soilml.io.cell_text import cell_as_text, is_number, read_numbers
from soilml.io.csv_by_arrow import read_good_csv
from soilml.io.spreadsheet import sheet_rows
from soilml.io.table import TEXT, Column, text_column

BLOCK = 8192  # Rows whose cells are held as text at a time
_LINE = 1_000_000  # Characters of a line; a longer one is not of a table
_SHOWN = 60  # Characters of a cell that a message shows
_QUOTES = "quotation marks must stand in pairs around a whole cell"

Rows = Iterable[tuple[int, list[str]]]  # Line of each row, and its cells


def read_csv(
    file: Path,
    columns: Callable[[list[str]], Sequence[str]],
    header_hint: str,
    progress: Callable[[int], None] | None = None,
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """The columns of a CSV file by name, and the line of each row.

    columns: The columns to keep, of those in the header; it raises where one of these is not
        possible.
    header_hint: What the header should be, for the message about an empty file.
    progress: Called with the number of bytes read, after each block of rows.

    Raises `OSError` where the file cannot be opened or read; `TableError` for text that is not
    UTF-8 or no table, a row with another number of cells than the header, and a cell that is not
    what its column holds.
    """
    if (found := read_good_csv(file, columns, _LINE, progress)) is not None:
        return found
    with file.open(encoding="utf-8-sig") as opened:
        reader, buffer = csv.reader(_lines(file, opened), strict=True), cast(Any, opened.buffer)
        rows = ((reader.line_num, row) for row in reader)
        try:
            told = None if progress is None else lambda: progress(buffer.tell())
            return _columns(file, rows, columns, header_hint, told)
        except UnicodeDecodeError as error:
            raise TableError(f"{file} cannot be read as text: {error}") from None
        except csv.Error as error:
            raise TableError(f"{file} line {reader.line_num}: {error}; {_QUOTES}") from None


def read_sheet(
    file: Path, columns: Callable[[list[str]], Sequence[str]], header_hint: str
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """What `read_csv` gives, of a sheet of a spreadsheet, a line being a row of the sheet.

    Raises as `read_csv` and `sheet_rows` do.
    """
    rows = [*dropwhile(lambda row: not row[1], enumerate(sheet_rows(file), 1))]
    width = len(rows[0][1]) if rows else 0
    filled = ((line, row + [""] * (width - len(row))) for line, row in rows)
    return _columns(file, filled, columns, header_hint, None)


def _columns(
    file: Path,
    rows: Rows,
    columns: Callable[[list[str]], Sequence[str]],
    header_hint: str,
    progress: Callable[[], None] | None,
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """The columns of rows of text, of which the first is the header, and the line of each."""
    rows = iter(rows)
    header = [name.strip() for name in next(rows, (0, []))[1]]
    if not header:
        raise TableError(f"{file} is empty; needed is a header: {header_hint}")
    COLUMNS.check(file, len(header))
    kept = list(columns(header))
    found = {n: [np.zeros(0, np.str_ if n in TEXT else np.float64)] for n in kept}
    lines: list[int] = []
    good = _good_rows(file, rows, len(header))
    while block := [*islice(good, BLOCK)]:
        lines += [line for line, _ in block]
        ROWS.check(file, len(lines))
        for name in kept:
            place = header.index(name)
            found[name].append(_column(file, name, [(n, row[place].strip()) for n, row in block]))
        if progress is not None:
            progress()
    for name in {*kept} & {*TEXT}:
        longest = max(part.itemsize for part in found[name])
        TEXT_BYTES.check(f"{file}, column {name}", longest * len(lines))
    joined = {name: np.concatenate(parts) for name, parts in found.items()}
    return joined, np.asarray(lines, dtype=np.int64)


def _lines(file: Path, opened: TextIO) -> Iterator[str]:
    """Lines of text; raises `TableError` for binary data and for endless lines."""
    for number, line in enumerate(iter(lambda: opened.readline(_LINE), ""), 1):
        if "\0" in line:
            raise TableError(f"{file} is not a CSV file: it contains binary data")
        if len(line) == _LINE:
            raise TableError(f"{file} line {number}: the line has {_LINE} characters or more")
        yield line


def _good_rows(file: Path, rows: Rows, width: int) -> Iterator[tuple[int, list[str]]]:
    """Rows that are not blank; raises `TableError` for one that is not of the table."""
    for line, row in rows:
        text = "".join(row)
        if not text.strip():
            continue
        if "\n" in text or "\r" in text:  # a quote that is not closed swallows the rows below
            raise TableError(f"{file} line {line}: a cell has several lines; {_QUOTES}")
        if len(row) != width:
            needed = f"needed are {width}, as in the header"
            raise TableError(f"{file} line {line}: {len(row)} cells; {needed}")
        yield line, row


def _column(file: Path, name: str, cells: Sequence[tuple[int, str]]) -> Column:
    """Cells with their lines as text or as numbers, NaN where blank."""
    if name in TEXT:
        texts = [cell_as_text(cell) for _, cell in cells]
        return text_column(texts, lambda i: f"{file} line {cells[i][0]}, column {name}")
    filled = [i for i, (_, cell) in enumerate(cells) if cell]
    values = np.full(len(cells), np.nan)
    try:
        values[filled] = read_numbers([cells[i][1] for i in filled])
    except ValueError:
        line, cell = next(one for one in cells if one[1] and not is_number(one[1]))
        shown = cell if len(cell) <= _SHOWN else f"{cell[:_SHOWN]}..."
        raise TableError(
            f"{file} line {line}, column {name}: {shown!r} is not a number; needed "
            "is a finite number, or a blank cell where it was not measured"
        ) from None
    return values
