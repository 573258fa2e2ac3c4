"""Text of plain cells by the reader of pyarrow, block by block, where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.bounds import COLUMNS, ROWS, TEXT_BYTES
from soilml.io.cell_text import cell_as_text
from soilml.io.table import TEXT, Column, text_column

#: Bytes of the smallest file that is read so: below, the import of pyarrow takes longer.
SMALLEST = 1 << 20
BLOCK = 1 << 20  # Bytes that are held at a time
Progress = Callable[[int], None] | None


def blocks_of_cells(
    opened: BinaryIO,
    header: Sequence[str],
    texts: Collection[str],
    kept: Sequence[str],
    progress: Progress,
    *,
    missing: Sequence[str] = ("",),
    separator: str = ",",
    decimal: str = ".",
    bad_line: Callable[[Any], str] = lambda row: "error",
    skip_empty: bool = False,
) -> Iterator[Any]:
    """Record batches of Arrow from the place of an opened file on, numbers where no text is.

    Raises a `ValueError` of pyarrow for a cell that is no number, a line that `bad_line` does not
    skip, and one that is longer than a block.
    """
    import pyarrow as pa
    from pyarrow import csv

    reader = csv.open_csv(
        opened,
        csv.ReadOptions(column_names=list(header), use_threads=False, block_size=BLOCK),
        csv.ParseOptions(
            delimiter=separator,
            quote_char=False,
            ignore_empty_lines=skip_empty,
            invalid_row_handler=bad_line,
        ),
        csv.ConvertOptions(
            column_types={n: pa.string() if n in texts else pa.float64() for n in header},
            include_columns=list(kept),
            null_values=list(missing),
            decimal_point=decimal,
        ),
    )
    for batch in reader:
        yield batch
        if progress is not None:
            progress(opened.tell())


def read_good_csv(
    file: Path, columns: Callable[[list[str]], Sequence[str]], longest: int, progress: Progress
) -> tuple[dict[str, Column], NDArray[np.int64]] | None:
    """What `read_csv` gives, to the last bit; None where it has to look at the file itself.

    It has to where there may be a fault, and where there are quotes, blank rows, or numbers that
    pyarrow does not know, as +1. `longest`: Characters of a line. Raises `OSError`.
    """
    if file.stat().st_size < SMALLEST:
        return None
    try:
        with file.open("rb") as opened:
            first = opened.readline(longest)
            _need(first.endswith(b"\n") and b'"' not in first and b"\r" not in first[:-2])
            header = [name.strip() for name in first.decode("utf-8-sig").split(",")]
            _need(1 < len(header) <= COLUMNS.most)
            kept = list(columns(header))
            found: dict[str, list[Column]] = {name: [] for name in kept}
            rows = 0
            for batch in blocks_of_cells(opened, header, TEXT, kept, progress):
                rows += len(batch)
                _need(rows <= ROWS.most)
                own = {name: _column(file, name, batch[name]) for name in kept}
                blank = [v == "" if v.dtype.kind == "U" else np.isnan(v) for v in own.values()]
                _need(not np.all(blank, axis=0).any())
                for name, values in own.items():
                    found[name].append(values)
        for name in set(TEXT) & found.keys():
            _need(max(part.itemsize for part in found[name]) * rows <= TEXT_BYTES.most)
        joined = {name: np.concatenate(parts) for name, parts in found.items()}
    except (ImportError, ValueError, TableError):  # pyarrow's own errors are kinds of `ValueError`
        return None
    return joined, np.arange(2, rows + 2)


def _need(holds: bool) -> None:
    if not holds:
        raise ValueError


def _column(file: Path, name: str, cells: Any) -> Column:
    """Cells as `read_csv` has them: text, or numbers with NaN where blank."""
    if name in TEXT:
        coded = cells.dictionary_encode()
        shown = [cell or "" for cell in coded.dictionary.to_pylist()]
        _need('"' not in "".join(shown))
        texts = [cell_as_text(cell.strip()) for cell in shown]
        column: Column = text_column(texts, lambda _: str(file))[coded.indices.to_numpy()]
        return column
    values = np.asarray(cells.to_numpy(zero_copy_only=False), dtype=np.float64)
    _need(not np.isinf(values).any() and int(np.isnan(values).sum()) == cells.null_count)
    return values
