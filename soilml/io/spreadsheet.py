"""Sheets of spreadsheets (.xlsx) as rows of text, as if the sheet were saved as a CSV file.

`BOOK.xlsx#SHEET` names a sheet; without a name, the one sheet that has cells is meant.
"""

from __future__ import annotations

import datetime
import posixpath
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from soilml.errors import TableError
from soilml.io.bounds import SHEET_BYTES, SHEET_CELLS, TEXT_BYTES
from soilml.optional_imports import need

ENDINGS = (".xlsx", ".xlsm")
_SHEET = re.compile(r"(.+\.xls[xm])#([^#]+)", re.IGNORECASE | re.DOTALL)
_SHOWN = 12  # Most sheets that a message names
#: A cell in the XML of a sheet that has some attribute, and the place that it states.
_CELL = rb"""<(?:\w+:)?c(?=\s)%s[^>]*?\sr=["']([A-Z]{1,3})(\d{1,7})["'][^>]*>"""
_SHARED = re.compile(rb"""<(?:\w+:)?c(?=\s)[^>]*\st=["']s["']""")  # A cell whose text is shared
_ANY_CELL = re.compile(rb"<(?:\w+:)?c[\s/>]")
_PLACED = re.compile(_CELL % b"")
_ERROR = re.compile(
    _CELL % rb"""(?=[^>]*\st=["']e["'])""" + rb"(?<!/>)(?:(?!</(?:\w+:)?c>).)*?<(?:\w+:)?v>([^<]*)",
    re.DOTALL,
)
_UNCOUNTED = re.compile(  # a formula without a value
    _CELL % b"" + rb"\s*<(?:\w+:)?f(?:\s[^>]*)?(?:/>|>[^<]*</(?:\w+:)?f>)\s*"
    rb"(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v></(?:\w+:)?v>)?\s*</(?:\w+:)?c>"
)
_NUMBERS = (int, float)  # Types of cells that are numbers
_PERCENT_FORMATS = ("9", "10")  # Numbers of the built-in formats with %

Place = tuple[int, int]  # Row and column, from 0
Cells = list[list[Any]]


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
    """The names of the sheets of a spreadsheet that have cells; raises as `sheet_rows` does."""
    with _opened(file) as book:
        return book.filled()


def sheet_rows(path: Path) -> list[list[str]]:
    """The rows of a sheet as texts, from the first row on.

    Rows have no blank cells at their end; a row without any is an empty list. Dates are written as
    2024-05-31 12:00:00, what is shown in per cent below a head with % is a hundred times its value.

    path: A spreadsheet, or `BOOK.xlsx#SHEET`.

    Raises `TableError` where the file is no spreadsheet, damaged or too large; where several
    sheets have cells and none is named; where cells are merged, a formula has no value, or a date
    stands among numbers. `OSError` where the file cannot be read, and `MissingLibraryError`
    without python-calamine.
    """
    file, name = split_sheet(path)
    with _opened(file) as book:
        title = book.chosen(name)
        where = f"{file}, sheet {title!r}"
        xml, sheet = book.sheet(title)
        rows: Cells = sheet.to_python(skip_empty_area=False)
        for found in _ERROR.finditer(xml):  # such as #N/A, which calamine leaves blank
            row, column = _place(found)
            if row < len(rows) and column < len(rows[row]):
                rows[row][column] = found[3].decode()
        _check_merged(where, rows, sheet.merged_cell_ranges or ())
        if (b"<f" in xml or b":f" in xml) and (formula := _UNCOUNTED.search(xml)):
            raise TableError(
                f"{where}, cell {_cell_name(_place(formula))}: a formula whose value is not in the "
                "file; open it in a spreadsheet program and save it"
            )
        _check_dates(where, rows)
        return _texts(rows, book.in_percent(xml))


@contextmanager
def _opened(file: Path) -> Iterator[_Book]:
    """A spreadsheet, closed at the end; what fails within is a damaged part of it."""
    need("python_calamine", "", "logs", what=f"{file}: reading spreadsheets")
    from python_calamine import CalamineWorkbook

    try:
        with zipfile.ZipFile(file) as packed:
            # a part is read to its declared size and no further
            SHEET_BYTES.check(file, sum(part.file_size for part in packed.infolist()))
            parts = _parts(packed)
            _check_size(file, packed, parts.values())
            with CalamineWorkbook.from_path(file) as cells_of:
                yield _Book(file, packed, cells_of, parts)
    except (OSError, TableError):
        raise
    except zipfile.BadZipFile:
        raise TableError(
            f"{file} is no .xlsx file: it is damaged, has a password, or is of the older kind .xls;"
            " open it in a spreadsheet program and save it as .xlsx or CSV"
        ) from None
    except Exception as error:  # of many kinds, by the part that is damaged
        said = " ".join(str(error).split())[:80] or type(error).__name__
        raise TableError(
            f"{file} is a damaged spreadsheet ({said}); open it in a spreadsheet program and save "
            "it anew, or save the sheet as CSV"
        ) from None


def _check_size(file: Path, packed: zipfile.ZipFile, sheets: Iterable[str]) -> None:
    """Raise `TableError` for a sheet that takes more memory than its XML.

    Calamine fills all cells between A1 and the last one, and copies a shared text into each cell
    that has it: some kB can stand for many GB.
    """
    names = [name for name in packed.namelist() if "sharedstrings" in name.lower()]
    texts = [text for name in names for text in packed.read(name).split(b"</")]
    longest = max(map(len, texts), default=0)
    for sheet in sheets:
        xml = packed.read(sheet)
        places = [_place(found) for found in _PLACED.finditer(xml)]
        rows, columns = (1 + max((p[i] for p in places), default=0) for i in (0, 1))
        SHEET_CELLS.check(file, rows * columns)
        TEXT_BYTES.check(file, longest * len(_SHARED.findall(xml)))


def _parts(packed: zipfile.ZipFile) -> dict[str, str]:
    """The sheets that can have cells, and the part of each."""
    relations = ElementTree.fromstring(packed.read("xl/_rels/workbook.xml.rels"))
    targets = {relation.get("Id"): relation.get("Target", "") for relation in relations}
    parts = {}
    for sheet in ElementTree.fromstring(packed.read("xl/workbook.xml")).iterfind(".//{*}sheet"):
        target = targets[next(value for key, value in sheet.items() if key.endswith("}id"))]
        if "worksheets/" in target:
            parts[sheet.get("name", "")] = posixpath.join("/xl", target)[1:]
    return parts


@dataclass(frozen=True)
class _Book:
    """An open spreadsheet, and what calamine does not tell of it."""

    file: Path
    packed: zipfile.ZipFile
    cells_of: Any  # the workbook as calamine opens it
    parts: dict[str, str]  # of its sheets

    def sheet(self, title: str) -> tuple[bytes, Any]:
        """The XML of a sheet, and its cells."""
        xml = self.packed.read(self.parts[title])
        if len(_PLACED.findall(xml)) < len(_ANY_CELL.findall(xml)):
            raise ValueError(f"sheet {title!r} has cells without their places")
        return xml, self.cells_of.get_sheet_by_name(title)

    def in_percent(self, xml: bytes) -> set[Place]:
        """The cells that are shown in per cent."""
        if "xl/styles.xml" not in self.packed.namelist():
            return set()
        root = ElementTree.fromstring(self.packed.read("xl/styles.xml"))
        own = {f.get("numFmtId"): f.get("formatCode", "") for f in root.iterfind(".//{*}numFmt")}
        shown = {*_PERCENT_FORMATS, *(number for number, code in own.items() if "%" in code)}
        styles = enumerate(root.iterfind("{*}cellXfs/*"))
        numbers = "|".join(str(i) for i, style in styles if style.get("numFmtId") in shown)
        style = rb"""(?=[^>]*\ss=["'](?:%s)["'])""" % numbers.encode()
        return {_place(found) for found in re.finditer(_CELL % style, xml)} if numbers else set()

    def filled(self) -> list[str]:
        """The sheets that have cells."""
        return [title for title in self.parts if self.sheet(title)[1].end is not None]

    def chosen(self, name: str) -> str:
        """The named sheet, or the one that has cells."""
        file, sheets = self.file, list(self.parts)
        if name:
            by_case = {title.casefold(): title for title in sheets}
            if name.casefold() not in by_case:
                raise TableError(f"{file} has no sheet {name!r}; there are: {_listed(sheets)}")
            return by_case[name.casefold()]
        filled = sheets if len(sheets) == 1 else self.filled()
        if len(filled) > 1:
            raise TableError(
                f"{file} has {len(filled)} sheets: {_listed(filled)}; needed is the name of one, "
                f"as {file.name}#{filled[0]}"
            )
        if not filled:
            raise TableError(f"{file} has no sheet with cells")
        return filled[0]


def _listed(sheets: Sequence[str]) -> str:
    return ", ".join(map(repr, sheets[:_SHOWN])) + ", ..." * (len(sheets) > _SHOWN)


def _place(found: re.Match[bytes]) -> Place:
    column = 0
    for letter in found[1]:  # 1 for A, 27 for AA
        column = 26 * column + letter - 64
    return int(found[2]) - 1, column - 1


def _cell_name(place: Place) -> str:
    """B3 for row 2 and column 1."""
    return f"{_letters(place[1])}{place[0] + 1}"


def _letters(column: int) -> str:
    return _letters(column // 26 - 1) + chr(65 + column % 26) if column >= 0 else ""


def _check_merged(where: str, rows: Cells, merged: Sequence[tuple[Place, Place]]) -> None:
    """Refuse merged cells, but for a title that stands alone in its rows."""
    for first, last in merged:
        if sum(value != "" for row in rows[first[0] : last[0] + 1] for value in row) > 1:
            raise TableError(
                f"{where}: the cells {_cell_name(first)}:{_cell_name(last)} are merged; needed is "
                "a value in each cell, and one name above each column: unmerge them and fill the "
                "blank ones"
            )


def _check_dates(where: str, rows: Cells) -> None:
    """Refuse a date in a column of numbers: a spreadsheet takes 1.4 for the first of April."""
    width = len(rows[0]) if rows else 0
    if not any(isinstance(value, datetime.date) for row in rows for value in row):
        return
    # lines before a table, as `date: 2024-05-31`, have a name and a value
    wide = [i for i, row in enumerate(rows) if sum(v != "" for v in row) > min(2, width - 1)]
    for column in range(width):
        dates = [i for i in wide if isinstance(rows[i][column], datetime.date)]
        if dates and any(type(rows[i][column]) in _NUMBERS for i in wide):
            raise TableError(
                f"{where}, cell {_cell_name((dates[0], column))}: a date among numbers; the "
                "spreadsheet has taken a number such as 1.4 for it: type it anew, in cells "
                "formatted as numbers"
            )


def _texts(rows: Cells, percents: set[Place]) -> list[list[str]]:
    """The cells as texts, without blank ones at the ends of rows and without blank last rows."""
    heads: set[int] = set()  # columns whose head says %
    for i, row in enumerate(rows if percents else ()):
        for j, value in enumerate(row):
            if isinstance(value, str) and "%" in value:
                heads.add(j)
            elif (i, j) in percents and j in heads and type(value) in _NUMBERS:
                row[j] = float(f"{100.0 * value:.15g}")
    found = []
    for row in rows:
        texts = [str(v).removesuffix(".0") if type(v) is float else _text(v) for v in row]
        while texts and not texts[-1]:
            texts.pop()
        found.append(texts)
    while found and not found[-1]:
        found.pop()
    return found


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime.timedelta):
        minutes, seconds = divmod(value.total_seconds(), 60.0)
        return f"{int(minutes // 60):02d}:{int(minutes % 60):02d}:{seconds:09.6f}"
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        return f"{value} 00:00:00"
    return " ".join(str(value).split())  # a tab or a new line would divide the cell
