"""Parquet logs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.io.bounds import LOG_VALUES
from soilml.io.parquet import distinct_cells, read_parquet
from soilml.log_import.recording import Recording


def read_parquet_log(path: Path) -> list[Recording]:
    """The table of a Parquet file: numbers, times as seconds, text as text.

    Raises `TableError` for a damaged file and one of more than the bounds, `MissingLibraryError`
    without pyarrow.
    """
    found, _ = read_parquet(path, LOG_VALUES)
    columns: dict[str, Floats] = {}
    texts: dict[str, list[str]] = {}
    for name, column in found.items():
        values = _numbers(column)
        if values is not None:
            columns[name] = values
        else:
            texts[name] = _texts(column)
    return [Recording("", path, columns, texts)]


def _texts(column: Any) -> list[str]:
    """The cells of an Arrow column as text; equal ones are one object."""
    import pyarrow as pa

    if pa.types.is_nested(column.type) and not pa.types.is_dictionary(column.type):
        return ["" if cell is None else str(cell) for cell in column.to_pylist()]
    cells, code = distinct_cells(column)
    shown = ["" if cell is None else str(cell) for cell in cells]
    return [shown[i] for i in code.tolist()]


def _numbers(column: Any) -> Floats | None:
    """An Arrow column as numbers, times in s; None for text."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        per_second = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
        raw = column.cast(pa.int64()).to_numpy()
        return np.asarray(raw, dtype=np.float64) / per_second
    if (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_decimal(kind)
    ):
        values = np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
        return np.where(np.isfinite(values), values, np.nan)
    return None
