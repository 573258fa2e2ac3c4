"""Measured rows as Python holds them: a table, a data frame, or columns by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilml.errors import TableError
from soilml.io.parquet import ArrowStream
from soilml.io.read_table import FILLED, check_table, known_columns, read_table
from soilml.io.table import TEXT, Column, Table, fault_of_text

#: What the analyses take as rows.
Rows = Table | ArrowStream | Mapping[str, ArrayLike]


def as_table(rows: Rows) -> Table:
    """The table of rows; data frames and columns are checked as files are.

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
        return rows
    if isinstance(rows, ArrowStream):
        return read_table(rows)
    if not isinstance(rows, Mapping):
        raise TableError(
            f"rows are {type(rows).__name__}; needed is a Table, as read_table returns it, a data "
            "frame, or a mapping of columns by name"
        )
    file = Path("rows")
    columns = {name: _column(name, rows[name]) for name in known_columns(file, list(rows), False)}
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise TableError(f"rows: columns differ in length: {listed}")
    return check_table(Table(columns, str(file)), file, (), FILLED, None)


def _column(name: str, values: ArrayLike) -> Column:
    """A column (rows,) of text or of numbers; a single value is a column of one row."""
    try:
        given = np.atleast_1d(np.asarray(values))
    except ValueError:  # lists of different lengths
        raise TableError(f"rows, column {name}: needed is one value a row") from None
    if given.ndim != 1:
        raise TableError(f"rows, column {name}: has shape {given.shape}; needed is one value a row")
    if name in TEXT:
        return _text(name, given)
    if given.dtype.kind in "iuf":
        return given.astype(np.float64)
    cells = given.tolist()
    if given.dtype.kind != "O" or not all(c is None or _is_number(c) for c in cells):
        raise TableError(f"rows, column {name}: needed are numbers, and None where one is missing")
    return np.asarray([np.nan if c is None else c for c in cells], dtype=np.float64)


def _is_number(cell: object) -> bool:
    return isinstance(cell, int | float | np.number) and not isinstance(cell, bool)


def _text(name: str, given: NDArray[Any]) -> Column:
    """A column of text, "" where blank, as a file would have it."""
    names = ["" if c is None else str(c).strip() for c in given.tolist()]
    for i, cell in enumerate(names):
        if fault := fault_of_text(cell):
            raise TableError(f"rows, row {i + 1}, column {name}: {fault}")
    return np.asarray(names, dtype=np.str_)
