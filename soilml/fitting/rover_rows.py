"""Rows of a rover's wheels: the gear and the pass of each, from the wheel's name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import TableError
from soilml.io.table import Table


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
