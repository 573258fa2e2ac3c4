"""Text logs of any length in blocks, by the reader of pyarrow where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.io.bounds import KEPT_VALUES
from soilml.log_import.readers.text_layout import MISSING, TextLayout

SMALLEST = 1 << 18  # Bytes from which a log is read so: below, the import of pyarrow takes longer
_BLOCK = 1 << 20  # Bytes that are held at a time


@dataclass(frozen=True)
class ReadColumns:
    """Numbers and texts by column, of one sample in `every`; lines of another width left out."""

    columns: dict[str, Floats]
    texts: dict[str, list[str]]
    every: int
    bad: int


def read_by_arrow(
    path: Path,
    start: int,
    layout: TextLayout,
    texts: Iterable[str],
    line: float,
    progress: Callable[[int], None] | None,
) -> ReadColumns | None:
    """The columns of a log of plain cells; None for one that the reader of lines has to look at.

    It has to where a cell is no number, as in a second header. Of a log that holds more values than
    memory has room for, one sample in some is read, evenly over the whole.

    start: Bytes before the first sample.
    texts: Names of the columns that hold text.
    line: Usual bytes of a line.
    """
    try:
        import pyarrow as pa
        from pyarrow import csv
    except ImportError:
        return None
    size, text = path.stat().st_size - start, set(texts)
    every = max(1, -int(-size / line * len(layout.names) // KEPT_VALUES))
    missing = [spelt for cell in MISSING for spelt in {cell, cell.upper(), cell.title(), "NaN"}]
    bad = 0

    def skipped(row: Any) -> str:
        nonlocal bad
        bad += 1
        return "skip" if every > 1 else "error"

    found: dict[str, list[Any]] = {name: [] for name in layout.names}
    types = {name: pa.string() if name in text else pa.float64() for name in layout.names}
    try:
        with path.open("rb") as opened:
            opened.seek(start)
            reader = csv.open_csv(
                opened,
                csv.ReadOptions(
                    column_names=list(layout.names), use_threads=False, block_size=_BLOCK
                ),
                csv.ParseOptions(
                    delimiter=layout.separator, quote_char=False, invalid_row_handler=skipped
                ),
                csv.ConvertOptions(
                    column_types=types,
                    null_values=missing,
                    strings_can_be_null=False,
                    decimal_point="," if layout.decimal_comma else ".",
                ),
            )
            first = 0
            for batch in reader:
                for name in layout.names:
                    cells = batch.column(name)
                    if every > 1:
                        cells = cells.take(pa.array(np.arange(first, len(batch), every)))
                    if name in text:
                        found[name] += [cell.strip() for cell in cells.to_pylist()]
                    else:
                        found[name].append(cells.to_numpy(zero_copy_only=False))
                first = (first - len(batch)) % every
                if progress is not None:
                    progress(opened.tell())
    except (pa.ArrowInvalid, pa.ArrowKeyError, UnicodeDecodeError):
        return None
    columns = {}
    for name in layout.names:
        if name not in text:
            columns[name] = np.concatenate(found.pop(name)).astype(np.float64)
    return ReadColumns(columns, found, every, bad)
