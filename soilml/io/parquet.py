"""Parquet files as tables, with the same checks as CSV files."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from soilml.errors import TableError
from soilml.io.table import MOST_ROWS, TEXT, Column, text_column
from soilml.optional_imports import need


def read_parquet(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Arrow columns by name, and the file's metadata; page checksums are verified if present.

    The path is a file, or a folder whose Parquet files are one table, in the order of their names.
    Raises `OSError` where it is missing, `TableError` where a file is damaged or has a column
    twice, or where a folder has no file, files of different tables, or fewer rows than it should.
    """
    need("pyarrow", "", what=f"{path}: reading Parquet")
    import pyarrow as pa

    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise TableError(f"{path} is a folder without a Parquet file")
    _check_rows(path, files)
    tables = [_read_file(file) for file in files]
    first = _metadata(tables[0])
    for file, table in zip(files, tables, strict=True):
        if not table.schema.equals(tables[0].schema) or _metadata(table) != first:
            raise TableError(f"{file} and {files[0]} are not of one table; read one of them")
    _check_recipe(path, first)
    arrow = pa.concat_tables(tables)
    rows = first.get("soilml_rows", "")
    if path.is_dir() and rows.isdecimal() and int(rows) != len(arrow):
        raise TableError(
            f"{path} has {len(arrow)} of {rows} rows: `soilml generate` was interrupted; the same "
            "command completes it"
        )
    return dict(zip(arrow.column_names, arrow.columns, strict=True)), first


@runtime_checkable
class ArrowStream(Protocol):
    """What exports its rows by the Arrow PyCapsule interface: data frames of many libraries."""

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """A capsule with an ArrowArrayStream."""
        ...


def arrow_columns(frame: ArrowStream) -> dict[str, Any]:
    """Arrow columns by name of a data frame; raises `TableError` for a column that occurs twice."""
    need("pyarrow", "", what="reading a data frame")
    import pyarrow as pa

    arrow = pa.table(frame)
    if len(set(arrow.column_names)) < len(arrow.column_names):
        raise TableError("data frame: a column occurs twice")
    return dict(zip(arrow.column_names, arrow.columns, strict=True))


def _check_rows(path: Path, files: Sequence[Path]) -> None:
    """Raise `TableError` for more than `MOST_ROWS` rows, before any of them is read.

    A column that repeats one value takes hardly any room in a file, and all of it in memory.
    """
    rows = sum(_opened(file, lambda opened: int(opened.metadata.num_rows)) for file in files)
    if rows > MOST_ROWS:
        raise TableError(f"{path} has more than {MOST_ROWS} rows; split it, or thin it")


def _opened(file: Path, read: Callable[[Any], Any]) -> Any:
    """What a function reads of an opened file; raises `TableError` for a damaged one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with file.open("rb"):  # raises where it is missing or may not be read
        # threads of Arrow that read from an object of Python abort the process where it ends first
        try:
            with pa.OSFile(os.fsencode(file)) as opened:
                return read(pq.ParquetFile(opened, page_checksum_verification=True))
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            first = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise TableError(f"{file} is not a complete Parquet file: {first}") from None


def _read_file(file: Path) -> Any:
    """The content of one file as an Arrow table."""
    arrow = _opened(file, lambda opened: opened.read())
    names = arrow.column_names
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TableError(f"{file}: column {twice} occurs twice")
    return arrow


def _metadata(table: Any) -> dict[str, str]:
    """Metadata of a table, without what tells the files of a folder apart."""
    return {
        key.decode(errors="replace"): value.decode(errors="replace")
        for key, value in (table.schema.metadata or {}).items()
        if key != b"soilml_part"
    }


def _check_recipe(path: Path, metadata: dict[str, str]) -> None:
    """Raise `TableError` where the recipe in the metadata is not the one that was written."""
    recipe = metadata.get("soilml_recipe")
    if recipe is None:
        if "soilml_recipe_sha256" in metadata:
            raise TableError(
                f"{path}: its metadata have the checksum of a recipe and no recipe; generate it "
                "again"
            )
    elif hashlib.sha256(recipe.encode()).hexdigest() != metadata.get("soilml_recipe_sha256"):
        raise TableError(
            f"{path}: the recipe in its metadata does not match its checksum; generate it again"
        )


def own_columns(metadata: Mapping[str, str]) -> list[str]:
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
    if pa.types.is_string_view(column.type):  # of polars
        column = column.cast(pa.string())
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
    return text_column(cells, lambda i: f"{file} line {i + 1}, column {name}")
