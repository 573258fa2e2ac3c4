"""Logs in spreadsheets."""

from __future__ import annotations

from pathlib import Path

from soilml.io.spreadsheet import sheet_rows
from soilml.log_import.readers.delimited_text import recordings_of
from soilml.log_import.recording import Recording


def read_spreadsheet_log(path: Path) -> list[Recording]:
    """The table of a sheet, whose header and line of units are found as those of a text log.

    path: A spreadsheet, or `BOOK.xlsx#SHEET`.

    Raises `InputError` where the sheet has no samples, and as `sheet_rows` does.
    """
    rows = sheet_rows(path)
    width = max(map(len, rows), default=0)
    # cells hold no tab; a quotation mark, as of inches, must not seem to open a quoted cell
    lines = ["\t".join([*row, *[""] * (width - len(row))]).replace('"', "''") for row in rows]
    return recordings_of(path, lines, ())
