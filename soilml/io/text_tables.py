"""Writing tables as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from soilml.io.cell_text import text_as_cell

Columns = Mapping[str, Sequence[Any] | np.ndarray[Any, Any]]

BLOCK = 8192  # Rows that are formatted at a time


def csv_text(columns: Columns) -> str:
    """The columns as CSV; NaN becomes a blank cell, numbers keep ten digits."""
    return "".join(csv_blocks(columns))


def csv_blocks(columns: Columns) -> Iterator[str]:
    """The text of `csv_text` in blocks of rows, so that a long table is never held as text."""
    yield _csv([list(columns)])
    rows = {len(values) for values in columns.values()}
    if len(rows) > 1:
        raise ValueError(f"columns of {sorted(rows)} rows are not one table")
    for start in range(0, max(rows, default=0), BLOCK):
        cells = [
            [_cell(value) for value in values[start : start + BLOCK]] for values in columns.values()
        ]
        yield _csv(zip(*cells, strict=True))


def _csv(rows: Any) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.10g}"
    return text_as_cell(value) if isinstance(value, str) else str(value)
