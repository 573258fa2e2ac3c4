"""Tables of a report: columns of numbers in SI units with what is known of them, or of texts.

How numbers are rounded and in which units they are shown is decided here, once for all forms.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.report.aligned_text import WIDTH, format_table
from soilml.report.numbers import (
    format_quantity,
    format_range,
    parameter_name,
    rounded,
    shown_column,
    shown_unit,
)

_MOST_TEXT = 36  # Characters of a cell of text on a terminal
_LEAST_LAST = 24  # Characters of a last column of words, at least
_ENDINGS = ("_std", "_p05", "_p95")


@dataclass(frozen=True)
class Column:
    """A column of a table: numbers in an SI unit with what is known of them, or texts.

    heading: Words above it.
    values: (n,) numbers, texts or truth values; NaN is a blank cell.
    unit: SI unit, of all rows or of each; `share` for a fraction that is shown in percent.
    std, ends: Standard deviations (n,), and ends of 90 % intervals, (n,) each.
    digits: Significant digits of numbers of which no uncertainty is given.
    sizes: Values (n,) of the column beside it by whose size units are chosen, and which states
        them; by default its own.
    """

    heading: str
    values: Sequence[Any]
    unit: str | Sequence[str] = "1"
    std: Sequence[float] | None = None
    ends: tuple[Sequence[float], Sequence[float]] | None = None
    digits: int = 4
    sizes: Sequence[float] | None = None

    @staticmethod
    def of_bands(heading: str, bands: Iterable[Any], unit: str = "1", digits: int = 3) -> Column:
        """The `middle` of bands with their ends, `lower` and `upper`."""
        values = [(float(b.lower), float(b.middle), float(b.upper)) for b in bands]
        low, middle, high = ([v[i] for v in values] for i in range(3))
        return Column(heading, middle, unit, ends=(low, high), digits=digits)

    @staticmethod
    def of_ranges(
        heading: str,
        ranges: Sequence[tuple[float, float]],
        units: Sequence[str],
        sizes: Sequence[float],
    ) -> Column:
        """Ranges as words, in the units of a column of these sizes beside it."""
        cells = []
        for (low, high), unit, size in zip(ranges, units, sizes, strict=True):
            factor, _ = shown_unit(unit, abs(size))
            cells.append(format_range(factor * low, factor * high))
        return Column(heading, cells)

    @property
    def is_text(self) -> bool:
        """Whether its cells are words."""
        return any(isinstance(value, str) for value in self.values)

    def cells(self) -> Iterator[tuple[str, list[str]]]:
        """Headings and cells: of the values, of their units where rows differ, of the intervals."""
        if self.is_text or np.asarray(self.values).dtype.kind == "b":
            words = {True: "yes", False: "no"}
            yield (
                self.heading,
                [words[bool(v)] if isinstance(v, bool | np.bool_) else str(v) for v in self.values],
            )
            return
        values = [float("nan") if v is None else float(v) for v in self.values]
        count = len(values)
        std = [0.0] * count if self.std is None else [float(s) for s in self.std]
        low, high = ([float(e) for e in end] for end in self.ends or ([np.nan] * count,) * 2)
        one = isinstance(self.unit, str)
        largest = max((abs(v) for v in values if np.isfinite(v)), default=0.0)
        factors = [
            shown_unit(unit, largest if one else abs(v))
            for unit, v in zip(
                _of_rows(self),
                self.sizes if self.sizes is not None else values,
                strict=True,
            )
        ]
        shown, ends = [], []
        for (factor, _), value, error, a, b in zip(factors, values, std, low, high, strict=True):
            width = error if error > 0.0 else (b - a) / 3.3 if self.ends else 0.0
            text = rounded(factor * value, factor * width, self.digits)
            if text and error > 0.0 and np.isfinite(error):
                text += f" +- {rounded(factor * error, factor * error)}"
            shown.append(text)
            both = [rounded(factor * end, factor * width, self.digits) for end in (a, b)]
            ends.append(" to ".join(both) if all(both) else "")
        unit = shown_unit(self.unit, largest)[1] if one else ""  # type: ignore[arg-type]
        yield f"{self.heading}, {unit}" if unit else self.heading, shown
        if self.ends is not None:
            yield "90 %", ends
        if not one and self.sizes is None:
            yield "unit", [unit for _, unit in factors]


def _chained(parts: Iterable[Sequence[Any]]) -> list[Any]:
    return [value for part in parts for value in part]


def _of_rows(column: Column) -> list[str]:
    """The unit of each row."""
    unit = column.unit
    return [unit] * len(column.values) if isinstance(unit, str) else list(unit)


@dataclass(frozen=True)
class ReportTable:
    """A table: its title, its columns, and a sentence on how to read it."""

    title: str
    columns: Sequence[Column]
    note: str = ""

    @staticmethod
    def of(title: str, columns: Mapping[str, Any], note: str = "") -> ReportTable:
        """The table of columns that are named as in a file: `NAME_UNIT`, `_std`, `_p05`, `_p95`."""
        found = []
        for name, values in columns.items():
            if any(name.endswith(e) and name.removesuffix(e) in columns for e in _ENDINGS):
                continue
            factor, heading = shown_column(name)
            values = np.asarray(values).tolist()
            if factor != 1.0:
                values = [factor * value for value in values]
            std, low, high = (
                None
                if (own := columns.get(name + ending)) is None
                else (factor * np.asarray(own)).tolist()
                for ending in _ENDINGS
            )
            ends = None if low is None or high is None else (low, high)
            found.append(Column(heading, values, "1", std, ends))
        return ReportTable(title, found, note)

    @staticmethod
    def of_parameters(
        title: str, columns: Mapping[str, Any], note: str = "", **more: Any
    ) -> ReportTable:
        """The table of `frame_columns`: parameter, mean, std, low, high, unit, a row for each.

        more: Further columns by their headings.
        """
        names = [parameter_name(name) for name in columns["parameter"]]
        ends = (list(columns["low"]), list(columns["high"]))
        value = Column("value", list(columns["mean"]), list(columns["unit"]), columns["std"], ends)
        others = [
            own if isinstance(own, Column) else Column(head.replace("_", " "), own)
            for head, own in more.items()
        ]
        return ReportTable(title, [Column("parameter", names), value, *others], note)

    @staticmethod
    def joined(tables: Mapping[str, ReportTable], by: str) -> ReportTable:
        """Tables of the same columns below each other, with their names in a first column."""
        first, parts = next(iter(tables.values())), list(tables.values())
        names = [n for n, table in tables.items() for _ in table.columns[0].values]
        columns = [Column(by, names)]
        for k, own in enumerate(first.columns):
            every = [table.columns[k] for table in parts]
            units = [_of_rows(c) for c in every]
            ends = [[v for c in every if c.ends for v in c.ends[end]] for end in (0, 1)]
            joined: dict[str, Any] = {
                name: _chained(getattr(c, name) for c in every)
                for name in ("values", "std", "sizes")
                if getattr(own, name) is not None
            }
            unit = own.unit if isinstance(own.unit, str) else _chained(units)
            if own.ends:
                joined["ends"] = ends[0], ends[1]
            columns.append(replace(own, unit=unit, **joined))
        return replace(first, columns=columns)

    def cells(self) -> tuple[list[str], list[list[str]], list[bool]]:
        """Headings, rows of cells, and which columns are words."""
        heads, columns, words = [], [], []
        for column in self.columns:
            for heading, cells in column.cells():
                heads.append(heading)
                columns.append(cells)
                words.append(column.is_text or heading == "unit")
        return heads, [list(row) for row in zip(*columns, strict=True)], words

    def text(self, width: int = WIDTH, most: int | None = None) -> str:
        """The table for a terminal; columns that do not fit are left out, and a line names them.

        Those are first the intervals of numbers whose standard deviation is shown, then the last
        ones. A last column of words is broken into lines.
        """
        heads, rows, words = self.cells()
        count, rows = len(rows), rows[:most]
        cut = [[_cut(cell) for cell in row[:-1]] + row[-1:] for row in rows]
        widths = [max(map(len, column)) + 2 for column in zip(heads, *cut, strict=True)]
        widths[-1] = min(widths[-1], _LEAST_LAST) if words[-1] else widths[-1]
        kept = list(range(len(heads)))
        spare = [
            k for k in kept[:0:-1] if heads[k] == "90 %" and any("+-" in r[k - 1] for r in rows)
        ]
        for k in dict.fromkeys([*spare, *kept[:0:-1]]):
            if sum(widths[i] for i in kept) - 2 <= width:
                break
            kept.remove(k)
        names = [
            f"90 % of {heads[k - 1]}" if head == "90 %" else head for k, head in enumerate(heads)
        ]
        left = ", ".join(names[k] for k in range(len(heads)) if k not in kept)
        text_columns = next((n for n, k in enumerate(kept) if not words[k]), len(kept))
        shown = [[row[k] for k in kept] for row in cut]
        table = format_table([heads[k] for k in kept], shown, text_columns, words[kept[-1]], width)
        more = f"\nand {count - len(rows)} more rows" if count > len(rows) else ""
        named = f"\n{textwrap.fill(f'not shown here: {left}', width)}" if left else ""
        return f"{table}{more}{named}"

    def sentences(self) -> list[str]:
        """A line for each row: its first cell, and the numbers of the second column."""
        first, value = self.columns[:2]
        count, units = len(first.values), _of_rows(value)
        low, high = value.ends or ([np.nan] * count,) * 2
        std = value.std if value.std is not None else [0.0] * count
        return [
            f"{name} = {format_quantity(float(v), unit, float(s), (float(a), float(b)))}"
            for name, v, unit, s, a, b in zip(
                first.values, value.values, units, std, low, high, strict=True
            )
        ]


def _cut(cell: str) -> str:
    return cell if len(cell) <= _MOST_TEXT else f"{cell[: _MOST_TEXT - 3]}..."
