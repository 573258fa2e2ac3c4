"""How large the sheets of a spreadsheet are, from the XML in it, before a library reads them.

A reader fills all cells between A1 and the last one, and copies a shared text into each cell that
has it: some kB can stand for many GB. ECMA-376, part 1, 18.3 and 18.4.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.parsers import expat

from soilml.errors import TableError
from soilml.io.bounds import SHEET_BYTES, SHEET_CELLS, TEXT_BYTES

_BLOCK = 1 << 20
_LETTERS = {letter: i for i, letter in enumerate("ABCDEFGHIJKLMNOPQRSTUVWXYZ", 1)}


def check_spreadsheet_size(file: Path) -> None:
    """Raise `TableError` for a file that unpacks to more, or has a larger sheet, than is read.

    Also for a file that is no .xlsx file or is damaged. Raises `OSError` where it cannot be read.
    """
    try:
        with zipfile.ZipFile(file) as packed:
            # a part is read to its declared size and no further
            SHEET_BYTES.check(file, sum(part.file_size for part in packed.infolist()))
            shared: list[int] = []
            # the texts come before the sheets; a part may have any name
            for name in sorted(packed.namelist(), key=lambda n: "sharedstrings" not in n.lower()):
                part = _Part(file, shared)
                with packed.open(name) as opened:
                    _parse(part, opened)
    except (TableError, OSError):
        raise
    except Exception:  # of many kinds, by the part that is damaged
        raise TableError(
            f"{file} is no .xlsx file: it is damaged, has a password, or is of the older kind .xls;"
            " open it in a spreadsheet program and save it as .xlsx or CSV"
        ) from None


def _parse(part: _Part, opened: Any) -> None:
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler = part.start
    parser.EndElementHandler = part.end
    parser.CharacterDataHandler = part.text
    try:
        while (block := opened.read(_BLOCK)) and not part.is_other:
            parser.Parse(block)
        if part.is_table:
            parser.Parse(b"", True)
    except expat.ExpatError:
        if part.is_table:
            raise ValueError("damaged") from None


class _Part:
    """Rows, columns and characters of a sheet, or the lengths of the shared texts."""

    def __init__(self, file: Path, shared: list[int]) -> None:
        self.file, self.shared = file, shared
        self.kind = ""
        self.row = self.column = self.last_row = self.last_column = self.characters = 0
        self.length, self.value = 0, ""
        self.is_shared = False

    @property
    def is_table(self) -> bool:
        return self.kind in ("worksheet", "sst")

    @property
    def is_other(self) -> bool:
        return bool(self.kind) and not self.is_table

    def start(self, name: str, attributes: dict[str, str]) -> None:
        name = name.rpartition(" ")[2]
        self.kind = self.kind or name
        if name == "row":
            number = attributes.get("r", "")
            self.row = int(number) if number.isdecimal() and len(number) < 9 else self.row + 1
            self.column = 0
        elif name == "c":
            self.row, self.column = _place(attributes.get("r", ""), self.row, self.column)
            self.is_shared = attributes.get("t") == "s"
        elif name == "si":
            self.length = 0
        elif name in ("v", "is", "f"):
            self.last_row = max(self.last_row, self.row)
            self.last_column = max(self.last_column, self.column)
            SHEET_CELLS.check(self.file, self.last_row * self.last_column)
            self.value = ""

    def text(self, text: str) -> None:
        self.length += len(text)
        if self.is_shared and len(self.value) < 9:
            self.value += text

    def end(self, name: str) -> None:
        name = name.rpartition(" ")[2]
        if name == "si":
            self.shared.append(self.length)
        elif name == "v" and self.is_shared:
            index = int(self.value) if self.value.strip().isdecimal() else -1
            self.characters += self.shared[index] if 0 <= index < len(self.shared) else 0
            TEXT_BYTES.check(self.file, self.characters)


def _place(reference: str, row: int, column: int) -> tuple[int, int]:
    """Row and column of a cell such as B7; without a reference it follows the one before."""
    letters = reference.rstrip("0123456789")
    if not letters or len(reference) > 20:
        return row, column + 1
    column = 0
    for letter in letters.upper():
        column = 26 * column + _LETTERS.get(letter, 0)
    number = reference[len(letters) :]
    return int(number) if number else row, column
