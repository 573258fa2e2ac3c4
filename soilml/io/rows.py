"""Measured rows as Python holds them: a table, a data frame, or columns by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from soilml.errors import TableError
from soilml.io.parquet import ArrowStream
from soilml.io.read_table import FILLED, check_table, known_columns, read_table
from soilml.io.table import TEXT, Column, Table

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
    kind, needed = (np.str_, "text") if name in TEXT else (np.float64, "numbers")
    try:
        column = np.atleast_1d(np.asarray(values, dtype=kind))
    except (TypeError, ValueError):
        raise TableError(f"rows, column {name}: needed are {needed}") from None
    if column.ndim != 1:
        raise TableError(
            f"rows, column {name}: has shape {column.shape}; needed is one value a row"
        )
    return column
