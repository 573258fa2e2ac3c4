"""Large CSV files without a fault, by the reader of pyarrow where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.bounds import COLUMNS, ROWS, TEXT_BYTES
from soilml.io.cell_text import cell_as_text
from soilml.io.table import TEXT, Column, text_column

#: Bytes of the smallest file that is read so: below, the import of pyarrow takes longer.
SMALLEST = 1 << 20
BLOCK = 1 << 24  # Bytes that are held at a time


def read_good_csv(
    file: Path,
    columns: Callable[[list[str]], Sequence[str]],
    longest: int,
    progress: Callable[[int], None] | None,
) -> tuple[dict[str, Column], NDArray[np.int64]] | None:
    """What `read_csv` gives, to the last bit; None where it has to look at the file itself.

    It has to where there may be a fault, and where there are quotes, blank rows, or numbers that
    pyarrow does not know, as +1. `longest`: Characters of a line. Raises `OSError`.
    """
    if file.stat().st_size < SMALLEST:
        return None
    try:
        return _read(file, columns, longest, progress)
    except (ImportError, ValueError, TableError):  # pyarrow's own errors are kinds of `ValueError`
        return None


def _read(
    file: Path,
    columns: Callable[[list[str]], Sequence[str]],
    longest: int,
    progress: Callable[[int], None] | None,
) -> tuple[dict[str, Column], NDArray[np.int64]]:
    """The same; raises `ValueError` where it is None."""
    import pyarrow as pa
    from pyarrow import csv

    with file.open("rb") as opened:
        first = opened.readline(longest)
        _need(first.endswith(b"\n") and b'"' not in first)
        header = [name.strip() for name in first.decode("utf-8-sig").split(",")]
        _need(len(header) <= COLUMNS.most)
        kept = list(columns(header))
        types = {name: pa.string() if name in TEXT else pa.float64() for name in kept}
        parsed = csv.ConvertOptions(column_types=types, include_columns=kept, null_values=[""])
        found: dict[str, list[Column]] = {name: [] for name in kept}
        lines, before = [np.zeros(0, dtype=np.int64)], 1
        for block in _whole_lines(opened):
            numbers, count = _lines(block, longest)
            table = csv.read_csv(
                pa.BufferReader(block),
                csv.ReadOptions(use_threads=False, column_names=header, block_size=len(block) + 1),
                csv.ParseOptions(quote_char=False),
                parsed,
            )
            _need(len(table) == len(numbers))
            blank = np.ones(len(table), dtype=bool)
            for name in kept:
                found[name].append(_column(file, name, table[name]))
                blank &= found[name][-1] == "" if name in TEXT else np.isnan(found[name][-1])
            _need(not blank.any())
            lines.append(numbers + before)
            before += count
            _need(sum(map(len, lines)) <= ROWS.most)
            if progress is not None:
                progress(opened.tell())
    for name in set(TEXT) & found.keys():
        widest = max((part.itemsize for part in found[name]), default=0)
        _need(widest * sum(map(len, found[name])) <= TEXT_BYTES.most)
    return {name: np.concatenate(parts) for name, parts in found.items()}, np.concatenate(lines)


def _need(holds: bool) -> None:
    if not holds:
        raise ValueError


def _whole_lines(opened: Any) -> Iterator[bytes]:
    """Blocks that end with a line."""
    while block := opened.read(BLOCK):
        yield block + opened.readline()


def _lines(block: bytes, longest: int) -> tuple[NDArray[np.int64], int]:
    """The numbers, from 1, of the lines that are not empty, and the count of all lines."""
    _need(b'"' not in block and b"\0" not in block)
    _need(block.count(b"\r") == block.count(b"\r\n"))
    if not block.isascii():
        block.decode()
    bytes_ = np.frombuffer(block, dtype=np.uint8)
    ends = np.flatnonzero(bytes_ == ord("\n"))
    if not block.endswith(b"\n"):
        ends = np.append(ends, len(block))
    lengths = np.diff(ends, prepend=-1) - 1
    _need(int(lengths.max(initial=0)) < longest)
    empty = (lengths == 0) | ((lengths == 1) & (bytes_[ends - 1] == ord("\r")))
    return np.flatnonzero(~empty) + 1, len(ends)


def _column(file: Path, name: str, cells: Any) -> Column:
    """Cells as `read_csv` has them: text, or numbers with NaN where blank."""
    if name in TEXT:
        coded = cells.combine_chunks().dictionary_encode()
        texts = [cell_as_text(text.strip()) for text in coded.dictionary.to_pylist()]
        column: Column = text_column(texts, lambda _: str(file))[coded.indices.to_numpy()]
        return column
    values = np.asarray(cells.to_numpy(), dtype=np.float64)
    _need(not np.isinf(values).any() and int(np.isnan(values).sum()) == cells.null_count)
    return values
