"""How much a file may hold: each bound of a reader, with its reason, checked before it reads.

A small file can ask for any amount of memory: by one value for millions of rows, by an array that
is packed, by a cell at the far end of a sheet. What is read beyond a bound would end the process.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from soilml.errors import TableError


@dataclass(frozen=True)
class Bound:
    """The most of something that a reader takes, and what its user can do instead."""

    most: int
    what: str
    hint: str

    def check(self, file: str | Path, count: int) -> None:
        """Raise `TableError`, in one line, where there are more."""
        if count > self.most:
            raise TableError(f"{file} has more than {self.most} {self.what}; {self.hint}")


_SPLIT = "split it, or thin it"
#: Ten times what a campaign of years has; a column of numbers takes 80 MB.
ROWS = Bound(10_000_000, "rows", _SPLIT)
#: Logs of rovers have some hundred; a column is compared with every known name, some ms each.
COLUMNS = Bound(2_000, "columns", "keep those of wheel, motion and time")
#: Numbers of a table: 1.3 GB in memory, of which training takes data sets of this size.
TABLE_VALUES = Bound(160_000_000, "values", _SPLIT)
#: Rows that `estimate` answers one by one or in sets; each takes about a tenth of a millisecond.
ESTIMATES = Bound(2_000_000, "rows to estimate", "thin it, or choose some with --where")
#: Numbers of a log: 320 MB, some times over while it is resampled.
LOG_VALUES = Bound(40_000_000, "values", "import it in parts")
#: Numbers that are kept of a log that is read in blocks; beyond, one sample in some is read.
KEPT_VALUES = 20_000_000
#: Characters of a name; every row of a column takes the memory of the longest.
MOST_TEXT = 256
#: Bytes of a column of text in memory, 4 for each character: ten million names of 13 characters.
TEXT_BYTES = Bound(512 << 20, "bytes of text", "shorten the names, or split it")
#: Bytes of a text log; its cells take some times as much.
LOG_BYTES = Bound(1 << 30, "bytes", "import it in parts")
#: Bytes of a JSON file, whose values take twenty times as much in memory.
JSON_BYTES = Bound(64 << 20, "bytes", "save it as CSV or Parquet, or in parts")
#: Bytes of one compressed block of a recording; writers take some MB.
BLOCK_BYTES = Bound(256 << 20, "bytes in a compressed block", "record it in smaller ones")
#: Arrays, structs and cells of a MATLAB or HDF5 file, some hundred bytes each beside their values.
PARTS = Bound(200_000, "arrays and structs", "save the channels as arrays of all samples")
#: Of those in one another; the library that reads them calls itself for each.
DEPTH = Bound(32, "structs in one another", "save the channels as arrays of all samples")
_INSTEAD = "save the sheet as CSV, or the rows as Parquet"
#: Cells from A1 to the last row and column that have one: readers fill what lies between.
SHEET_CELLS = Bound(2_000_000, "cells from A1 to its last row and column", _INSTEAD)
#: Bytes of a spreadsheet once unpacked.
SHEET_BYTES = Bound(256 << 20, "bytes unpacked", _INSTEAD)
#: Characters of settings; those of the project have some thousand.
SETTINGS = Bound(4_000_000, "characters", "needed are settings in TOML")
