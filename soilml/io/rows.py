"""Measured rows as Python holds them: a table, a data frame, or columns by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilml.errors import TableError
from soilml.io.parquet import ArrowStream, own_columns
from soilml.io.read_table import FILLED, check_table, known_columns, read_table
from soilml.io.table import TEXT, Column, Table, fault_of_text

#: What the analyses take as rows.
Rows = Table | ArrowStream | Mapping[str, ArrayLike]


def as_table(rows: Rows) -> Table:
    """The table of rows; data frames, columns and tables made of them are checked as files are.

    Parameters
    ----------
    rows
        A `Table`; a data frame of pandas, polars or pyarrow; or a mapping of columns (rows,) by
        names such as load_N, numbers and, for runs, text.

    Raises
    ------
    TableError
        For another object, columns of different lengths, and what `read_table` refuses.

    Examples
    --------
    >>> len(as_table({"slip": [0.1, 0.2], "load_N": [60, 60], "torque_Nm": [1.5, 2.0]}))
    2
    """
    if isinstance(rows, Table):
        # the rows of files have been checked, and have the lines of their file
        return rows if len(rows.line) else _checked(rows.columns, rows.source, rows.metadata)
    if isinstance(rows, ArrowStream):
        return read_table(rows)
    if not isinstance(rows, Mapping):
        raise TableError(
            f"rows are {type(rows).__name__}; needed is a Table, as read_table returns it, a data "
            "frame, or a mapping of columns by name"
        )
    return _checked(rows, "rows", {})


def _checked(rows: Mapping[str, ArrayLike], source: str, metadata: Mapping[str, str]) -> Table:
    """A table of columns by name; `source` is what messages call it."""
    odd = next((name for name in rows if not isinstance(name, str)), None)
    if odd is not None:
        raise TableError(f"{source}: a column is named {odd!r}; needed is a text such as 'load_N'")
    file = Path(source)
    names = known_columns(file, list(rows), False, own_columns(metadata))
    columns = {name: _column(source, name, rows[name]) for name in names}
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise TableError(f"{source}: columns differ in length: {listed}")
    table = Table(columns, source, metadata=dict(metadata))
    return check_table(table, file, (), FILLED, None)


def _column(source: str, name: str, values: ArrayLike) -> Column:
    """A column (rows,) of text or of numbers; a single value is a column of one row."""
    try:
        given = np.atleast_1d(np.asarray(values))
    except ValueError:  # lists of different lengths
        raise TableError(f"{source}, column {name}: needed is one value a row") from None
    if given.ndim != 1:
        shape = given.shape
        raise TableError(f"{source}, column {name}: has shape {shape}; needed is one value a row")
    if name in TEXT:
        return _text(source, name, given)
    if given.dtype.kind in "iuf":
        return given.astype(np.float64)
    cells = given.tolist()
    if given.dtype.kind != "O" or not all(c is None or _is_number(c) for c in cells):
        raise TableError(
            f"{source}, column {name}: needed are numbers, and None where one is missing"
        )
    return np.asarray([np.nan if c is None else c for c in cells], dtype=np.float64)


def _is_number(cell: object) -> bool:
    return isinstance(cell, int | float | np.number) and not isinstance(cell, bool)


def _text(source: str, name: str, given: NDArray[Any]) -> Column:
    """A column of text, "" where blank, as a file would have it."""
    names = ["" if c is None else str(c).strip() for c in given.tolist()]
    for i, cell in enumerate(names):
        if fault := fault_of_text(cell):
            raise TableError(f"{source}, row {i + 1}, column {name}: {fault}")
    return np.asarray(names, dtype=np.str_)
