"""Operating points of the rows of a table, and the gear and pass of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.model_settings import UNNAMED_GEAR
from soilml.errors import TableError
from soilml.io.table import Table
from soilml.physics.operating_point import COVARIATES, Operating


def operating_points(table: Table) -> Operating:
    """The rows of a table as they were driven; a covariate with a blank cell counts as unknown."""
    known = {
        field: table[key]
        for field, key in COVARIATES.items()
        if key in table and np.isfinite(table[key]).all()
    }
    gear = None
    if "gear" in table:
        gear = np.where(table["gear"] == "", UNNAMED_GEAR, table["gear"])
    return Operating(slip=table["slip"], load=table["load_N"], gear=gear, **known)


def gear_numbers(at: Operating) -> NDArray[np.int64]:
    """Number of the gear that drove each row, (n,); 0 where none is named."""
    if at.gear is None:
        return np.zeros(np.broadcast(at.slip, at.load).size, dtype=np.int64)
    return np.unique(at.gear, return_inverse=True)[1].astype(np.int64)


@dataclass(frozen=True)
class GearRows:
    """The rows that one of several gears drove."""

    case: Case  # The case of this gear alone
    rows: NDArray[np.int64]  # Positions (k,) of its rows among all
    at: Operating  # Their operating points
    # Path in `case` of each parameter of the whole case that acts on this gear
    paths: dict[str, str]


def rows_by_gear(case: Case, at: Operating) -> Iterator[GearRows]:
    """The rows of each gear of a case with several; without names, the first gear drove them."""
    count = np.broadcast(at.slip, at.load).size
    first = next(iter(case.gears))
    driven = np.full(count, first) if at.gear is None else np.asarray(at.gear)
    for name in case.gears:
        rows = np.flatnonzero(driven == name)
        if rows.size:
            own = replace(operating_points_of_rows(at, rows), gear=None)
            yield GearRows(case.of_gear(name), rows, own, case.paths_of_gear(name))


def operating_points_of_rows(at: Operating, rows: NDArray[np.int64]) -> Operating:
    """Operating points of some rows."""
    values = {field: getattr(at, field) for field in ("slip", "load", "gear", *COVARIATES)}
    taken = {k: np.asarray(v)[rows] if np.ndim(v) else v for k, v in values.items()}
    return replace(at, **taken)


def with_rover_columns(case: Case, table: Table) -> Table:
    """The table with the columns `gear` and `pass` of each row's wheel, where it names wheels.

    Columns that the table has are kept. A case without [rover], or a table without the column
    `wheel`, changes nothing. Raises `TableError` for a wheel that [rover] does not have.
    """
    if case.rover is None or "wheel" not in table:
        return table
    names = table["wheel"]
    unknown = ~np.isin(names, list(case.rover.wheels))
    if unknown.any():
        row = int(np.argmax(unknown))
        given = repr(str(names[row])) if names[row] else "the cell is blank"
        raise TableError(
            f"{table.place(row)}, column wheel: {given}; wheels of [rover] are: "
            f"{', '.join(case.rover.wheels)}"
        )
    columns = dict(table.columns)
    if case.gears and "gear" not in columns:
        gears = wheel_gears(case)
        columns["gear"] = np.asarray([gears[name] for name in names])
    if "pass" not in columns:
        passes = wheel_passes(case)
        columns["pass"] = np.asarray([float(passes[name]) for name in names])
    return replace(table, columns=columns)


def wheel_gears(case: Case) -> dict[str, str]:
    """Name of the gear of each wheel of a case's rover; the first one where none is named."""
    assert case.rover is not None
    first = next(iter(case.gears), "")
    return {name: wheel.gear or first for name, wheel in case.rover.wheels.items()}


def wheel_passes(case: Case) -> dict[str, int]:
    """Pass of each wheel of a case's rover."""
    assert case.rover is not None
    gears = {
        name: case.gears[g].gear if g else case.model.gear for name, g in wheel_gears(case).items()
    }
    width = {name: float(getattr(gear, "width", 0.0)) for name, gear in gears.items()}
    return case.rover.pass_numbers(width)
