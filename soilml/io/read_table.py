"""Tables from files (CSV, Parquet, .xlsx), data frames and columns; errors name their place."""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from soilml.errors import TableError
from soilml.io.atomic_files import refuse_device
from soilml.io.csv_file import read_csv, read_sheet
from soilml.io.parquet import (
    ArrowStream,
    arrow_columns,
    own_columns,
    plain_column,
    read_parquet,
    without_index,
)
from soilml.io.spreadsheet import is_spreadsheet, split_sheet
from soilml.io.table import TEXT, Column, Table, text_column
from soilml.quantities import COLUMNS

#: Required columns of a table of measured runs; a blank cell is a missing measurement.
_OTHERS = {"drawbar_pull_N", "sinkage_m"}  # Measured quantities that need no torque beside them
RUNS = ("run", "slip", "load_N", "torque_Nm")
#: Name of the run of all rows of a table that has no column of runs.
ONE_RUN = "all rows"
#: Columns that `soilml simulate` adds, which follow from the others and are passed over.
DERIVED = (
    *("tractive_efficiency", "pull_efficiency", "traffic_class"),
    *("settling", "front_share", "belt_share", "rear_share"),
    *("trim_rad", "rear_sinkage_m", "belt_tension_N", "pressure_centre_m"),
)
FILLED = ("run", "slip", "load_N")  # Columns in which every row must have a value
Limits = tuple[float, float, str]  # Lower and upper bound, and what is needed in words
#: column -> (lower, upper, what is needed); a number must lie strictly between.
_LIMITS: dict[str, Limits] = {
    "slip": (
        -1.0 - 1e-9,
        1.0 + 1e-9,
        "a slip ratio, between -1 and 1, as a fraction and not in percent: 1 - v/(r omega); "
        "(r omega - v)/v = q is q/(1 + q)",
    ),
    "load_N": (1e-6, 1e7, "a load above zero and below 1e7, in N"),
    "torque_Nm": (-1e7, 1e7, "a torque between -1e7 and 1e7, in N m"),
    "drawbar_pull_N": (-1e7, 1e7, "a force between -1e7 and 1e7, in N"),
    "sinkage_m": (-1.0, 10.0, "a sinkage between -1 and 10, in m and not in mm"),
    "speed_m_s": (-100.0, 100.0, "a speed between -100 and 100, in m/s"),
    "pass": (1.0 - 1e-9, 1e4, "the number of a pass, 1 or more"),
    "slip_angle_rad": (-1.6, 1.6, "an angle between -1.6 and 1.6, in rad"),
    "progress": (-1e-9, 1.0 + 1e-9, "a share of the campaign, between 0 and 1"),
    "load_direction": (-1.0 - 1e-9, 1.0 + 1e-9, "1 where the load last rose, -1 where it fell"),
    "slope_rad": (-1.4, 1.4, "a slope in rad, positive uphill"),
    "roll_rad": (-1.4, 1.4, "a roll in rad"),
    "rim_speed_m_s": (-100.0, 100.0, "a speed between -100 and 100, in m/s"),
    "wheel_speed_rad_s": (-200.0, 200.0, "a speed between -200 and 200, in rad/s"),
    "angle_rad": (-3.2, 3.2, "an angle in rad, from straight down, positive forward"),
    "wheel_radius_m": (0.0, 1e3, "a radius above zero and below 1000, in m"),
    "wheel_width_m": (0.0, 1e3, "a width above zero and below 1000, in m"),
    "plate_radius_m": (0.0, 10.0, "a radius above zero and below 10, in m"),
    "plate_width_m": (0.0, 10.0, "a width above zero, in m"),
    "plate_length_m": (0.0, 10.0, "a length above zero, in m"),
    "plate_area_m2": (0.0, 100.0, "an area above zero, in m^2"),
    "outer_radius_m": (0.0, 10.0, "a radius above zero and below 10, in m"),
    "shear_displacement_m": (-1.0, 10.0, "a displacement in m"),
}
#: Slip at which a wheel that spins on the spot, or is locked, is computed: its forces are those of
#: a slip of 1 to a thousandth, and the model is defined below 1.
_SPINNING = 0.9999
_MOST = 1e30  # Magnitude of any other number; squares and products of such are finite
# What the analyses take as rows: a table, a data frame, columns, or the path of a file
Rows = Table | ArrowStream | Mapping[str, ArrayLike] | str | os.PathLike[str]


def read_table(
    path: str | os.PathLike[str] | ArrowStream,
    need: Sequence[str] = (),
    *,
    filled: Sequence[str] = FILLED,
    ignore_extra: bool = False,
    limits: Mapping[str, Limits] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Table:
    """Read a table of measured rows from a CSV or Parquet file, or from a data frame.

    Parameters
    ----------
    path
        A Parquet file where the name ends in `.parquet`, a spreadsheet (.xlsx, or BOOK.xlsx#SHEET
        where it has several sheets), otherwise a CSV file with a header and comma as separator.
        Column names carry their units, such as load_N and torque_Nm. Data frames of pandas, polars
        and pyarrow, and whatever else exports an Arrow stream, are read with the same checks.
    need
        Columns that must be present.
    filled
        Columns that must not have blank cells, where they are present.
    ignore_extra
        Ignore columns with unknown names. By default they are an error, because a misspelt column
        would otherwise be ignored without notice.
    limits
        Lower and upper bound of columns, and what is needed, in place of those of measured runs.
    progress
        Called with the number of bytes of a CSV file that are read.

    Returns
    -------
    Table
        Text columns (run, status, source, wheel) with "" and numbers with NaN for a blank cell.

    Raises
    ------
    TableError
        For the first error in the file: a missing file, column or value, an unknown column, a cell
        that is not a number, or a value outside the limits of its quantity, such as a slip of 2.
        A slip of 1 or -1, of a wheel that spins on the spot or is locked, is read as 0.9999 or
        -0.9999.
    MissingLibraryError
        For a Parquet file where pyarrow is not installed, a spreadsheet without python-calamine.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "runs.csv"
    ...     _ = file.write_text("run,slip,load_N,torque_Nm\\na,0.2,60,3.0\\na,0.4,60,\\n")
    ...     table = read_table(file, need=("run", "slip", "load_N"))
    >>> len(table), table["torque_Nm"]
    (2, array([ 3., nan]))
    """
    if isinstance(path, ArrowStream):
        file = Path("data frame")
        table = _of_arrow(file, arrow_columns(path), ignore_extra)
        return check_table(table, file, need, filled, limits)
    file, hint = Path(path), f"{', '.join(RUNS)}, ..."

    def kept(header: list[str]) -> list[str]:
        return known_columns(file, header, ignore_extra)

    try:
        refuse_device(split_sheet(file)[0])
        if file.suffix == ".parquet":
            found, metadata = read_parquet(file)
            table = _of_arrow(file, found, ignore_extra, metadata)
        elif is_spreadsheet(file):
            columns, lines = read_sheet(file, kept, hint)
            table = Table(columns, str(file), lines)
        else:
            columns, lines = read_csv(file, kept, hint, progress)
            table = Table(columns, str(file), lines)
    except FileNotFoundError:
        raise TableError(f"{file}: there is no such file") from None
    except OSError as error:
        raise TableError(f"{file} cannot be read: {error.strerror or error}") from None
    return check_table(table, file, need, filled, limits)


def check_table(
    table: Table,
    file: Path,
    need: Sequence[str],
    filled: Sequence[str],
    limits: Mapping[str, Limits] | None,
) -> Table:
    """The table, with its columns and values as they must be.

    `need`, `filled` and `limits` are those of `read_table`. Raises `TableError` for the first
    column that is missing, cell that is blank, or value outside its limits.
    """
    if "torque_Nm" in need and "torque_Nm" not in table and _OTHERS & table.columns.keys():
        # a table of pulls or sinkages alone: its torque was not measured
        unmeasured = {"torque_Nm": np.full(len(table), np.nan)}
        table = replace(table, columns={**table.columns, **unmeasured})
    if "run" in need and "run" not in table:
        table = replace(table, columns={"run": np.full(len(table), ONE_RUN), **table.columns})
    for name in need:
        if name not in table:
            hint = f"found: {', '.join(table.columns) or 'no column'}"
            if name == "torque_Nm":
                hint = "needed is a torque, a drawbar_pull_N or a sinkage_m"
            raise TableError(f"{file}: column {name} is missing; {hint}")
    if len(table) == 0:
        raise TableError(f"{file}: the table has a header but no row")
    _check_values(table, filled, _LIMITS | dict(limits or {}))
    if "slip" in table and (np.abs(table["slip"]) > _SPINNING).any():
        whole = np.clip(table["slip"], -_SPINNING, _SPINNING)
        table = replace(table, columns={**table.columns, "slip": whole})
    return table


def _of_arrow(
    file: Path, found: Mapping[str, Any], ignore_extra: bool, metadata: dict[str, str] | None = None
) -> Table:
    """The table of Arrow columns, of a file where there is metadata."""
    found = without_index(found)
    kept = known_columns(file, list(found), ignore_extra, own_columns(metadata or {}))
    columns = {name: plain_column(file, name, found[name]) for name in kept}
    rows = 0 if metadata is None or not found else len(next(iter(found.values())))
    return Table(columns, str(file), np.arange(1, rows + 1), metadata or {})


def known_columns(
    file: Path, header: list[str], ignore_extra: bool, own: Sequence[str] = ()
) -> list[str]:
    """Columns of a header that are read; raises `TableError` for one that is not known."""
    kept: list[str] = []
    strange = [name for name in header if name not in (*own, *DERIVED) and name not in COLUMNS]
    if len(strange) == len(header) > 2 and not ignore_extra:
        hints = [(name, _misnamed(name)) for name in strange]
        shown = ", ".join(f"{name!r} ({hint})" if hint else repr(name) for name, hint in hints)
        raise TableError(
            f"{file}: none of its columns is known: {shown}; a table of runs has the columns "
            f"{', '.join(RUNS)}, in SI units; give other columns these names and units, "
            "or let `soilml import --init` guess what they are"
        )
    for name in header:
        base = name.removesuffix("_std")
        if header.count(name) > 1:
            raise TableError(f"{file}: column {name} occurs twice")
        if name in own or (base in COLUMNS and (base == name or base not in TEXT)):
            if name in own or name not in DERIVED:
                kept.append(name)
        elif name in DERIVED:
            continue
        elif hint := _misnamed(name):
            raise TableError(f"{file}: column {name!r}: {hint}")
        elif not ignore_extra:
            raise TableError(
                f"{file}: column {name!r} is not known; remove it, pass --ignore-extra, or let "
                "`soilml import --init` guess what it is"
            )
    return kept


def _misnamed(name: str) -> str:
    """A hint at the intended name of a column; empty where no name is similar."""
    if ";" in name or "\t" in name:
        return "the separator must be a comma"
    for quantity in sorted(COLUMNS.values(), key=lambda q: -len(q.name)):  # normal_stress, normal
        if name == quantity.name:
            return f"the unit is missing, name it {quantity.column}"
        if quantity.unit == "-" or len(quantity.name) <= 2:
            continue
        if name.startswith(f"{quantity.name}_"):
            also = [
                other.column
                for other in COLUMNS.values()
                if other.name.startswith(f"{quantity.name}_") and other.unit == quantity.unit
            ]
            return (
                f"{quantity.name.replace('_', ' ')} is read in {quantity.unit}; convert it and "
                f"name the column {' or '.join([quantity.column, *also])}"
            )
    near = difflib.get_close_matches(name.lower(), [c.lower() for c in COLUMNS], 1, 0.75)
    if near:
        return f"did you mean {next(c for c in COLUMNS if c.lower() == near[0])!r}?"
    return ""


def _check_values(table: Table, filled: Sequence[str], limits: Mapping[str, Limits]) -> None:
    for name, values in table.columns.items():
        if name in TEXT:
            bad, needed = values == "", "a name"
            blank = bad
        else:
            low, high, needed = limits.get(name, (-_MOST, _MOST, f"a number below {_MOST:g}"))
            if name.endswith("_std"):
                low, needed = 0.0, "a standard deviation above zero"
            blank = np.isnan(values)
            bad = ~blank & ~((values > low) & (values < high))
        if name in filled and blank.any():
            row = int(np.argmax(blank))
            raise TableError(
                f"{table.place(row)}, column {name}: the cell is blank; needed is {needed}"
            )
        if name not in TEXT and bad.any():
            row = int(np.argmax(bad))
            raise TableError(
                f"{table.place(row)}, column {name}: {values[row]:g} given; needed is {needed}"
            )


def as_table(rows: Rows) -> Table:
    """The table of rows; data frames, columns and tables made of them are checked as files are.

    rows: A `Table`; the path of a file; a data frame of pandas, polars or pyarrow; or a mapping of
        columns (rows,) by names such as load_N, numbers and, for runs, text.

    Raises `TableError` for another object, columns of different lengths, and what `read_table`
    refuses.

    Examples
    --------
    >>> len(as_table({"slip": [0.1, 0.2], "load_N": [60, 60], "torque_Nm": [1.5, 2.0]}))
    2
    """
    if isinstance(rows, Table):
        # the rows of files have been checked, and have the lines of their file
        return rows if len(rows.line) else _checked(rows.columns, rows.source, rows.metadata)
    if isinstance(rows, str | os.PathLike | ArrowStream):
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
    where = f"{source}, column {name}"
    try:
        given = np.atleast_1d(np.asarray(values))
    except ValueError:  # lists of different lengths
        raise TableError(f"{where}: needed is one value a row") from None
    if given.ndim != 1:
        raise TableError(f"{where}: has shape {given.shape}; needed is one value a row")
    if name in TEXT:
        return text_column(given.tolist(), lambda i: f"{source}, row {i + 1}, column {name}")
    if given.dtype.kind in "iuf":
        return given.astype(np.float64)
    cells = [np.nan if cell is None else cell for cell in given.tolist()]
    numbers = [isinstance(c, int | float | np.number) and not isinstance(c, bool) for c in cells]
    if given.dtype.kind != "O" or not all(numbers):
        raise TableError(f"{where}: needed are numbers, and None where one is missing")
    return np.asarray(cells, dtype=np.float64)
