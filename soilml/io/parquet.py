"""Parquet files as tables, with the same checks as CSV files."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from soilml.errors import TableError
from soilml.io.bounds import COLUMNS, ROWS, TABLE_VALUES, TEXT_BYTES, Bound
from soilml.io.table import TEXT, Column, text_column
from soilml.optional_imports import need

_INDEX = re.compile(r"__index_level_\d+__")  # As pandas names it in Arrow tables and Parquet files


def read_parquet(path: Path, most: Bound = TABLE_VALUES) -> tuple[dict[str, Any], dict[str, str]]:
    """Arrow columns by name, and the file's metadata; page checksums are verified if present.

    Columns of text are dictionaries: a value that repeats stands once in memory. `most` bounds the
    values of all columns.

    Raises `OSError` where it is missing, `TableError` where it is damaged, has a column twice or
    more than a bound of `soilml.io.bounds`.
    """
    need("pyarrow", "", what=f"{path}: reading Parquet")
    import pyarrow as pa

    _check_sizes(path, _opened(path, lambda opened: opened.metadata), most)
    schema = _opened(path, lambda opened: opened.schema_arrow)
    names = schema.names
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TableError(f"{path}: column {twice} occurs twice")
    texts = [name for name in names if pa.types.is_string(schema.field(name).type)]
    arrow = _opened(path, lambda opened: opened.read(), texts)
    held = (arrow.schema.metadata or {}).items()
    metadata = {k.decode(errors="replace"): v.decode(errors="replace") for k, v in held}
    _check_recipe(path, metadata)
    return dict(zip(arrow.column_names, arrow.columns, strict=True)), metadata


@runtime_checkable
class ArrowStream(Protocol):
    """What exports its rows by the Arrow PyCapsule interface: data frames of many libraries."""

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """A capsule with an ArrowArrayStream."""


def arrow_columns(frame: ArrowStream) -> dict[str, Any]:
    """Arrow columns by name of a data frame; raises `TableError` for a column that occurs twice."""
    need("pyarrow", "", what="reading a data frame")
    import pyarrow as pa

    try:
        arrow = pa.table(frame)
    except ValueError as error:  # among others of pandas, for a column that occurs twice
        raise TableError(f"data frame: {error}") from None
    if len(set(arrow.column_names)) < len(arrow.column_names):
        raise TableError("data frame: a column occurs twice")
    return dict(zip(arrow.column_names, arrow.columns, strict=True))


def without_index(found: Mapping[str, Any]) -> dict[str, Any]:
    """The columns but those in which pandas exports an index without a name."""
    return {name: column for name, column in found.items() if not _INDEX.fullmatch(name)}


def _check_sizes(path: Path, found: Any, most: Bound) -> None:
    """Raise `TableError` for more than may be read, as the end of the file states it.

    A column that repeats one value takes hardly any room in a file, and all of it in memory.
    """
    COLUMNS.check(path, int(found.num_columns))
    ROWS.check(path, int(found.num_rows))
    most.check(path, int(found.num_rows) * int(found.num_columns))
    groups = [found.row_group(i) for i in range(found.num_row_groups)]
    parts = [group.column(i) for group in groups for i in range(group.num_columns)]
    most.check(path, sum(int(part.num_values) for part in parts))  # of lists, more than rows
    kinds = ("BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY")
    texts = [int(p.total_uncompressed_size) for p in parts if p.physical_type in kinds]
    TEXT_BYTES.check(path, sum(texts))


def _opened(file: Path, read: Callable[[Any], Any], texts: Sequence[str] = ()) -> Any:
    """What a function reads of an opened file; raises `TableError` for a damaged one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with file.open("rb"):  # raises where it is missing or may not be read
        # threads of Arrow that read from an object of Python abort the process where it ends first
        try:
            with pa.OSFile(os.fsencode(file)) as opened:
                return read(
                    pq.ParquetFile(
                        opened, page_checksum_verification=True, read_dictionary=list(texts) or None
                    )
                )
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            first = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise TableError(f"{file} is not a complete Parquet file: {first}") from None


def _check_recipe(path: Path, metadata: dict[str, str]) -> None:
    """Raise `TableError` where the recipe in the metadata is not the one that was written."""
    recipe, stated = metadata.get("soilml_recipe"), metadata.get("soilml_recipe_sha256")
    fault = "has the checksum of a recipe and no recipe" if stated and recipe is None else ""
    if recipe is not None and hashlib.sha256(recipe.encode()).hexdigest() != stated:
        fault = "has a recipe that does not match its checksum"
    if fault:
        raise TableError(f"{path}: its metadata {fault}; generate it again")


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

    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
    text = any(f(kind) for f in (pa.types.is_string, pa.types.is_large_string, _is_view))
    if name not in TEXT:
        if not number:
            raise TableError(f"{file}, column {name}: has type {kind}; needed are numbers")
        return np.asarray(column.cast(kind).to_numpy(), dtype=np.float64)
    if not (text or pa.types.is_integer(kind) or pa.types.is_null(kind)):
        raise TableError(f"{file}, column {name}: has type {kind}; needed is text")
    try:
        cells, code = distinct_cells(column)
    except UnicodeDecodeError as error:
        raise TableError(f"{file}, column {name}: has text that is not UTF-8: {error}") from None
    texts = text_column(
        cells, lambda i: f"{file} line {int(np.argmax(code == i)) + 1}, column {name}"
    )
    TEXT_BYTES.check(f"{file}, column {name}", texts.itemsize * len(code))
    found: Column = texts[code]
    return found


def distinct_cells(column: Any) -> tuple[list[Any], Any]:
    """The values of an Arrow column, each once, and the index of that of each row (rows,)."""
    import pyarrow as pa

    if _is_view(column.type):  # of polars
        column = column.cast(pa.string())
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    whole = pa.chunked_array(column).unify_dictionaries().combine_chunks()
    code = np.asarray(whole.indices.fill_null(-1).to_numpy(zero_copy_only=False), np.int64)
    used, place = np.unique(code, return_inverse=True)
    cells = whole.dictionary.take(pa.array(used[used >= 0])).to_pylist()
    return [*[None] * int((used < 0).sum()), *cells], place


def _is_view(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_string_view(kind))
