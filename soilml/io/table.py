"""Tables of measurements: columns whose names carry their units."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.bounds import MOST_TEXT
from soilml.io.cell_text import is_plain, read_number
from soilml.results import data_frame
from soilml.row_status import Status

Column = NDArray[Any]

#: Columns that hold text; all others hold numbers, NaN where a cell is blank.
TEXT = ("run", "status", "source", "wheel", "gear", "test")


def fault_of_text(text: str) -> str:
    """What is wrong with a cell of text, in words; empty where nothing is."""
    if len(text) > MOST_TEXT:
        return f"the text has {len(text)} characters; at most {MOST_TEXT} are read"
    return "" if is_plain(text) else f"{text!a} has control characters; needed is plain text"


def text_column(cells: Iterable[Any], place: Callable[[int], str]) -> Column:
    """A column of text (rows,), "" where blank; `place` names the place of a row in messages.

    Raises `TableError` for a cell that is too long, and for one with control characters.
    """
    texts = ["" if cell is None else str(cell).strip() for cell in cells]
    for i, text in enumerate(texts):
        if fault := fault_of_text(text):
            raise TableError(f"{place(i)}: {fault}")
    return np.asarray(texts, dtype=np.str_)


ALL = "all"  # Name of the group of all rows; see `Table.groups`


@dataclass(frozen=True)
class Table:
    """Columns of equal length by name.

    Parameters
    ----------
    columns
        Arrays (rows,) by name: text for `TEXT`, otherwise numbers with NaN for a blank cell. Names
        carry the unit, as in load_N.
    source
        Name of the file, for messages.
    line
        Line of each row in its file, (rows,); empty for a table that is not from a file.
    metadata
        Metadata of the file, such as the recipe of simulated data.

    Examples
    --------
    >>> table = Table({"run": np.array(["a", "a", "b"]), "slip": np.array([0.1, 0.3, 0.2])})
    >>> [(name, len(rows)) for name, rows in table.groups()]
    [('a', 2), ('b', 1)]
    >>> table.where("run", "b")["slip"]
    array([0.2])
    """

    columns: dict[str, Column]
    source: str = "table"
    line: Column = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    metadata: dict[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """The rows as dictionaries by column, so that `pandas.DataFrame(table)` works."""
        for row in zip(*self.columns.values(), strict=True):
            yield dict(zip(self.columns, row, strict=True))

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Column:
        if name not in self.columns:
            shown, found = name or "''", ", ".join(self.columns) or "no column"
            raise TableError(f"{self.source}: column {shown} is missing; found: {found}")
        return self.columns[name]

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Rows whose status is ok or blank, (rows,); all rows of a table without the column."""
        if "status" not in self:
            return np.ones(len(self), dtype=bool)
        return np.isin(self["status"], ("", Status.OK.reason))

    def rows(self, index: Column) -> Table:
        """The rows of a boolean mask or of indices, in that order."""
        return Table(
            {name: values[index] for name, values in self.columns.items()},
            self.source,
            self.line[index] if len(self.line) else self.line,
            self.metadata,
        )

    def where(self, name: str, value: str) -> Table:
        """The rows whose column `name` has this value; raises `TableError` where there are none."""
        column = self[name]
        if name in TEXT:
            mask = column == value
        else:
            try:
                mask = column == read_number(value.strip())
            except ValueError:
                raise TableError(
                    f"{self.source}: column {name} contains numbers; {value!r} is not a number"
                ) from None
        if not mask.any():
            known = np.unique(column)
            some = ", ".join([str(v) for v in known[:6]] + ["..."] * (len(known) > 6))
            are = "values are" if len(known) > 1 else "the only value is"
            raise TableError(f"{self.source}: no row has {name} = {value}; {are} {some}")
        return self.rows(mask)

    def groups(self, name: str = "run") -> Iterator[tuple[str, Table]]:
        """(value, rows) for each value of a column, in order of first appearance.

        `all`, where no column has that name, is one group of all rows. Raises `TableError` for a
        blank cell, whose row would have no group.
        """
        if name == ALL and name not in self:
            yield ALL, self
            return
        column = self[name]
        blank = column == "" if name in TEXT else np.isnan(column)
        if blank.any():
            place = self.place(int(np.argmax(blank)))
            raise TableError(
                f"{place}, column {name}: the cell is blank; rows cannot be grouped by it"
            )
        values, first, code = np.unique(column, return_index=True, return_inverse=True)
        order = np.argsort(code, kind="stable")
        ends = np.cumsum(np.bincount(code))
        members = np.split(order, ends[:-1])
        for position in np.argsort(first):
            yield str(values[position]), self.rows(members[position])

    def to_frame(self) -> Any:
        """The columns as a data frame of pandas; `MissingLibraryError` without it."""
        return data_frame(self.columns)

    def place(self, row: int) -> str:
        """File and line of a row, for a message."""
        return f"{self.source} line {self.line[row]}" if len(self.line) else f"row {row + 1}"
