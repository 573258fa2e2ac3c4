"""Parquet files as tables, with the same checks as CSV files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import MissingLibraryError, TableError
from soilml.io.table import TEXT, Column


def read_parquet(file: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Arrow columns by name, and the file's metadata; page checksums are verified if present.

    Raises `OSError` where the file is missing, `TableError` where it is damaged or has a column
    twice.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingLibraryError(
            f"{file}: reading Parquet needs pyarrow: pip install 'soilml[ground]'"
        ) from None
    with file.open("rb") as opened:
        try:
            arrow = pq.ParquetFile(opened, page_checksum_verification=True).read()
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            first = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise TableError(f"{file} is not a complete Parquet file: {first}") from None
    names = arrow.column_names
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TableError(f"{file}: column {twice} occurs twice")
    metadata = {
        key.decode(errors="replace"): value.decode(errors="replace")
        for key, value in (arrow.schema.metadata or {}).items()
    }
    return dict(zip(names, arrow.columns, strict=True)), metadata


def own_columns(metadata: dict[str, str]) -> list[str]:
    """Columns whose units are in the file's own metadata, such as parameters of effects."""
    try:
        return list(json.loads(metadata.get("soilml_units", "{}")))
    except (ValueError, TypeError, RecursionError):
        return []


def plain_column(file: Path, name: str, column: Any) -> Column:
    """An arrow column as an array: text, "" where blank, or float64, NaN where blank.

    Raises `TableError` for another type: booleans, times and digits in quotes are not
    measurements.
    """
    import pyarrow as pa

    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = column.type
    number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
    text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
    if name not in TEXT:
        if not number:
            raise TableError(f"{file}, column {name}: has type {kind}; needed are numbers")
        return np.asarray(column.to_numpy(), dtype=np.float64)
    if not (text or pa.types.is_integer(kind) or pa.types.is_null(kind)):
        raise TableError(f"{file}, column {name}: has type {kind}; needed is text")
    try:
        cells = column.to_pylist()
    except UnicodeDecodeError as error:
        raise TableError(f"{file}, column {name}: has text that is not UTF-8: {error}") from None
    return np.asarray(["" if c is None else str(c).strip() for c in cells], dtype=np.str_)
