"""CSV files and sheets as columns, in blocks of rows; errors name file, line and column."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
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
#: Characters of a cell that a message shows.
_SHOWN = 60
_QUOTES = "quotation marks must stand in pairs around a whole cell"


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
        told = None if progress is None else lambda: progress(buffer.tell())
        try:
            return _columns(file, reader, columns, header_hint, told)
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
    return _columns(file, _SheetReader(sheet_rows(file)), columns, header_hint, None)


class _SheetReader(Iterator[list[str]]):
    """Rows of a sheet from its first one that is not blank, none shorter than that."""

    def __init__(self, rows: list[list[str]]) -> None:
        self.line_num = next((i for i, row in enumerate(rows) if row), len(rows))
        self._rows, self._width = rows, len(rows[self.line_num]) if self.line_num < len(rows) else 0

    def __next__(self) -> list[str]:
        if self.line_num == len(self._rows):
            raise StopIteration
        self.line_num += 1
        row = self._rows[self.line_num - 1]
        return row + [""] * (self._width - len(row))


def _columns(
    file: Path,
    reader: Any,
    columns: Callable[[list[str]], Sequence[str]],
    header_hint: str,
    progress: Callable[[], None] | None,
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """The columns of rows of text, of which the first is the header, and the line of each."""
    header = [name.strip() for name in next(reader, [])]
    if not header:
        raise TableError(f"{file} is empty; needed is a header: {header_hint}")
    COLUMNS.check(file, len(header))
    kept = list(columns(header))
    places = [header.index(name) for name in kept]
    blocks: list[list[Column]] = [[] for _ in kept]
    lines: list[NDArray[np.int64]] = [np.zeros(0, dtype=np.int64)]
    for numbers, rows in _blocks(file, reader, len(header)):
        lines.append(numbers)
        for name, place, filled in zip(kept, places, blocks, strict=True):
            cells = [row[place].strip() for row in rows]
            filled.append(_column(file, name, cells, numbers))
        if progress is not None:
            progress()
    for name, filled in zip(kept, blocks, strict=True):
        longest = max((part.itemsize for part in filled), default=0)
        TEXT_BYTES.check(f"{file}, column {name}", longest * sum(map(len, filled)) * (name in TEXT))
    empty = {name: np.zeros(0, np.str_ if name in TEXT else np.float64) for name in kept}
    found = {
        name: np.concatenate([empty[name], *filled])
        for name, filled in zip(kept, blocks, strict=True)
    }
    return found, np.concatenate(lines)


def _lines(file: Path, opened: TextIO) -> Iterator[str]:
    """Lines of text; raises `TableError` for binary data and for endless lines."""
    number = 0
    while line := opened.readline(_LINE):
        number += 1
        if "\0" in line:
            raise TableError(f"{file} is not a CSV file: it contains binary data")
        if len(line) == _LINE:
            raise TableError(f"{file} line {number}: the line has {_LINE} characters or more")
        yield line


def _blocks(
    file: Path, reader: Any, width: int
) -> Iterator[tuple[NDArray[np.int64], list[list[str]]]]:
    """Rows that are not blank, with their lines, in blocks."""
    rows: list[list[str]] = []
    lines: list[int] = []
    total = 0
    for row in reader:
        text = "".join(row)
        if not text.strip():
            continue
        if "\n" in text or "\r" in text:  # a quote that is not closed swallows the rows below
            raise TableError(f"{file} line {reader.line_num}: a cell has several lines; {_QUOTES}")
        if len(row) != width:
            raise TableError(
                f"{file} line {reader.line_num}: {len(row)} cells; needed are {width}, as in the "
                "header"
            )
        rows.append(row)
        lines.append(reader.line_num)
        total += 1
        ROWS.check(file, total)
        if len(rows) == BLOCK:
            yield np.asarray(lines, dtype=np.int64), rows
            rows, lines = [], []
    if rows:
        yield np.asarray(lines, dtype=np.int64), rows


def _column(file: Path, name: str, cells: list[str], lines: NDArray[np.int64]) -> Column:
    """Cells as text or as numbers, NaN where blank."""
    if name in TEXT:
        texts = [cell_as_text(cell) for cell in cells]
        return text_column(texts, lambda i: f"{file} line {lines[i]}, column {name}")
    filled = [i for i, cell in enumerate(cells) if cell]
    values = np.full(len(cells), np.nan)
    try:
        values[filled] = read_numbers([cells[i] for i in filled])
    except ValueError:
        wrong = next(i for i in filled if not is_number(cells[i]))
        shown = cells[wrong] if len(cells[wrong]) <= _SHOWN else f"{cells[wrong][:_SHOWN]}..."
        raise TableError(
            f"{file} line {lines[wrong]}, column {name}: {shown!r} is not a number; needed "
            "is a finite number, or a blank cell where it was not measured"
        ) from None
    return values
