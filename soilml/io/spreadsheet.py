"""Sheets of spreadsheets (.xlsx) as rows of text, as if the sheet were saved as a CSV file.

`BOOK.xlsx#SHEET` names a sheet; without a name, the one sheet that has cells is meant.
"""

from __future__ import annotations

import datetime
import re
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from soilml.errors import MissingLibraryError, TableError
from soilml.io.bounds import SHEET_CELLS
from soilml.io.spreadsheet_size import check_spreadsheet_size

ENDINGS = (".xlsx", ".xlsm")
_SHEET = re.compile(r"(.+\.xls[xm])#([^#]+)", re.IGNORECASE | re.DOTALL)
_MERGED = re.compile(rb'<(?:\w+:)?mergeCell\s[^>]*?ref="([A-Z0-9:]{1,40})"')
_FORMULA = re.compile(rb"<(?:\w+:)?f[\s/>]")
_BLOCK, _OVERLAP = 1 << 20, 256
_SHOWN = 12  # Most sheets that a message names


def split_sheet(path: str | Path) -> tuple[Path, str]:
    """The file of `BOOK.xlsx#SHEET`, and the sheet; "" where none is named.

    >>> split_sheet("tests.xlsx#dry sand")
    (PosixPath('tests.xlsx'), 'dry sand')
    >>> split_sheet("run#2.csv")
    (PosixPath('run#2.csv'), '')
    """
    file = Path(path)
    match = _SHEET.fullmatch(str(path))
    if match is None or file.exists():
        return file, ""
    return Path(match[1]), match[2]


def is_spreadsheet(path: str | Path) -> bool:
    """Whether a path names a spreadsheet that is read, with or without its sheet."""
    return split_sheet(path)[0].suffix.lower() in ENDINGS


def sheets_with_cells(file: Path) -> list[str]:
    """The names of the sheets of a spreadsheet that have cells; raises as `SheetRows` does."""
    check_spreadsheet_size(file)
    book = _opened(file, data_only=True)
    try:
        return [sheet.title for sheet in book.worksheets if _has_cells(file, sheet)]
    finally:
        book.close()


class SheetRows(Iterator[list[str]]):
    """The rows of a sheet as texts, like `csv.reader`: `line_num` is the row that came last.

    Rows have no blank cells at their end; a row without any is an empty list. Dates are written as
    2024-05-31 12:00:00, what is shown in per cent below a head with % is a hundred times its value.

    path: A spreadsheet, or `BOOK.xlsx#SHEET`.

    Raises `TableError` where the file is no spreadsheet, damaged or too large; where several
    sheets have cells and none is named; where cells are merged, a formula has no value, or a date
    stands among numbers. `OSError` where the file cannot be read, and `MissingLibraryError`
    without openpyxl.
    """

    def __init__(self, path: Path) -> None:
        self.line_num = 0
        self._rows = _rows(path)

    def __next__(self) -> list[str]:
        if self.line_num == len(self._rows):
            raise StopIteration
        self.line_num += 1
        return self._rows[self.line_num - 1]


def _rows(path: Path) -> list[list[str]]:
    file, name = split_sheet(path)
    check_spreadsheet_size(file)
    book = _opened(file, data_only=True)
    try:
        sheet = _chosen(file, book, name)
        where = f"{file}, sheet {sheet.title!r}"
        merged, has_formulas = _merged_and_formulas(file, sheet)
        cells = _cells(where, sheet)
        _check_merged(where, cells, merged)
        if has_formulas:
            _check_formulas(file, where, sheet.title, cells)
        _check_dates(where, cells)
        return _texts(cells)
    finally:
        book.close()


def _opened(file: Path, data_only: bool) -> Any:
    try:
        import openpyxl
    except ImportError:
        raise MissingLibraryError(
            f"{file}: reading spreadsheets needs openpyxl: pip install 'soilml[logs]'; or save the "
            "sheet as CSV"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of formats and extensions, which are not read
            return openpyxl.load_workbook(
                file, read_only=True, data_only=data_only, keep_links=False
            )
    except OSError:
        raise
    except Exception as error:  # of many kinds, by the part that is damaged
        _damaged(file, error)


def _damaged(file: Path, error: Exception) -> NoReturn:
    said = " ".join(str(error).split())[:80] or type(error).__name__
    raise TableError(
        f"{file} is a damaged spreadsheet ({said}); open it in a spreadsheet program and save it "
        "anew, or save the sheet as CSV"
    ) from None


def _chosen(file: Path, book: Any, name: str) -> Any:
    """The named sheet, or the one that has cells."""
    sheets = {sheet.title: sheet for sheet in book.worksheets}
    listed = ", ".join(map(repr, list(sheets)[:_SHOWN])) + ", ..." * (len(sheets) > _SHOWN)
    if name:
        by_case = {title.casefold(): title for title in sheets}
        if name.casefold() not in by_case:
            raise TableError(f"{file} has no sheet {name!r}; there are: {listed}")
        return sheets[by_case[name.casefold()]]
    filled = list(sheets)
    if len(sheets) > 1:
        filled = [title for title, sheet in sheets.items() if _has_cells(file, sheet)]
    if len(filled) == 1:
        return sheets[filled[0]]
    if not filled:
        raise TableError(f"{file} has no sheet with cells")
    raise TableError(
        f"{file} has {len(filled)} sheets: {', '.join(map(repr, filled[:_SHOWN]))}; needed is the "
        f"name of one, as {file.name}#{filled[0]}"
    )


def _has_cells(file: Path, sheet: Any) -> bool:
    sheet.reset_dimensions()  # what the file says of its size need not be true
    try:
        for _, row in zip(range(SHEET_CELLS.most), sheet.iter_rows(values_only=True), strict=False):
            if any(value is not None for value in row):
                return True
    except Exception as error:
        _damaged(file, error)
    return False


def _merged_and_formulas(file: Path, sheet: Any) -> tuple[list[str], bool]:
    """The ranges of merged cells, and whether there are formulas: openpyxl reads neither here."""
    merged: dict[str, None] = {}
    formulas, kept = False, b""
    with zipfile.ZipFile(file) as packed, packed.open(sheet._worksheet_path) as part:
        try:
            while block := part.read(_BLOCK):
                text = kept + block
                merged.update(dict.fromkeys(found.decode() for found in _MERGED.findall(text)))
                formulas = formulas or bool(_FORMULA.search(text))
                kept = text[-_OVERLAP:]
        except (zipfile.BadZipFile, EOFError) as error:
            _damaged(file, error)
    return list(merged), formulas


def _cells(where: str, sheet: Any) -> list[tuple[Any, ...]]:
    """All rows of cells, without blank ones at their ends."""
    sheet.reset_dimensions()
    rows: list[tuple[Any, ...]] = []
    last = 0
    try:
        for row in sheet.iter_rows():
            width = max((i + 1 for i, cell in enumerate(row) if cell.value is not None), default=0)
            rows.append(tuple(row[:width]))
            last = len(rows) if width else last
    except Exception as error:
        _damaged(Path(where), error)
    return rows[:last]


def _check_merged(where: str, rows: Sequence[Sequence[Any]], merged: Sequence[str]) -> None:
    """Refuse merged cells, but for a title that stands alone in its rows."""
    from openpyxl.utils import range_boundaries

    for found in merged:
        _, top, _, bottom = range_boundaries(found)
        filled = sum(c.value is not None for row in rows[top - 1 : bottom] for c in row)
        if filled > 1:
            raise TableError(
                f"{where}: the cells {found} are merged; needed is a value in each cell, and one "
                "name above each column: unmerge them and fill the blank ones"
            )


def _check_formulas(file: Path, where: str, title: str, rows: Sequence[Sequence[Any]]) -> None:
    """Refuse formulas whose value the file does not hold, as libraries write them."""
    book = _opened(file, data_only=False)
    try:
        sheet = book[title]
        sheet.reset_dimensions()
        for row, written in zip(rows, sheet.iter_rows(max_row=max(len(rows), 1)), strict=False):
            for i, cell in enumerate(written):
                if cell.data_type == "f" and (i >= len(row) or row[i].value is None):
                    raise TableError(
                        f"{where}, cell {cell.coordinate}: a formula whose value is not in the "
                        "file; open it in a spreadsheet program and save it"
                    )
    finally:
        book.close()


def _check_dates(where: str, rows: Sequence[Sequence[Any]]) -> None:
    """Refuse a date in a column of numbers: a spreadsheet takes 1.4 for the first of April."""
    width = max(map(len, rows), default=0)
    # lines before a table, as `date: 2024-05-31`, have a name and a value
    wide = [row for row in rows if sum(c.value is not None for c in row) > min(2, width - 1)]
    for i in range(width):
        column = [row[i] for row in wide if i < len(row) and row[i].value is not None]
        dates = [cell for cell in column if isinstance(cell.value, datetime.date)]
        if dates and any(_is_number(cell.value) for cell in column):
            raise TableError(
                f"{where}, cell {dates[0].coordinate}: a date among numbers; the spreadsheet has "
                "taken a number such as 1.4 for it: type it anew, in cells formatted as numbers"
            )


def _texts(rows: Sequence[Sequence[Any]]) -> list[list[str]]:
    in_percent: set[int] = set()  # columns whose head says %
    found = []
    for row in rows:
        texts = []
        for i, cell in enumerate(row):
            value = cell.value
            if isinstance(value, str) and "%" in value:
                in_percent.add(i)
            elif i in in_percent and _is_number(value) and "%" in cell.number_format:
                value = float(f"{100.0 * value:.15g}")
            texts.append(_text(value))
        found.append(texts)
    return found


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime.datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, datetime.timedelta):
        seconds = value.total_seconds()
        return f"{int(seconds // 3600):02d}:{int(seconds % 3600 // 60):02d}:{seconds % 60:09.6f}"
    # a tab or a new line would divide the cell
    return " ".join(str(value).split()) if isinstance(value, str) else str(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
