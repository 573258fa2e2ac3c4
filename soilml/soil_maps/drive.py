"""The rows of a drive with positions: places of the wheels, and stations along the path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.errors import FitError, TableError
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column

NEEDED = ("x_m", "y_m", "slip", "torque_Nm", "load_N")
LEAST_ROWS = 24  # Rows of a drive
#: A step of the path that is so many times the usual one, and at least so long (m), is a jump.
JUMP, LEAST_JUMP = 30.0, 1.0


@dataclass(frozen=True)
class MapDrive:
    """Rows (n,) of a drive in the order of their stations."""

    rows: dict[str, Floats]  # Inputs of an estimator by name, SI units
    place: Floats  # Of the wheel's contact, (n, 2), m
    station: Floats  # Along the path, m
    wheel: Integers  # Number of the wheel of each row
    row: Integers  # Position of each in the table, without the rows that lack a reading
    source: str

    def of_rows(self, rows: Any) -> dict[str, Floats]:
        """Inputs of an estimator of some rows."""
        return {name: values[rows] for name, values in self.rows.items()}

    def part(self, rows: Any) -> MapDrive:
        """The drive with some of its rows."""
        own = self.place[rows], self.station[rows], self.wheel[rows], self.row[rows]
        return MapDrive(self.of_rows(rows), *own, self.source)


def read_map_drive(table: Rows, case: Case) -> MapDrive:
    """The rows of a table with x_m, y_m, slip, torque_Nm and load_N, where all are known.

    Positions are those of the wheel's contact; where the table has heading_rad and wheel, those of
    the rover's origin, from which the contact follows by [rover.wheels]. With several wheels,
    time_s says which rows belong together.

    Raises `TableError` for a missing column or position, an unknown wheel and a position that
    jumps, and `FitError` for too few rows.
    """
    table = as_table(table)
    for name in NEEDED:
        if name not in table:
            raise TableError(
                f"{table.source}: column {name} is missing; soilml drive map needs "
                f"{', '.join(NEEDED)}"
            )
    for name in ("x_m", "y_m"):
        blank = ~np.isfinite(table[name])
        if blank.any():
            cell = table.place(int(np.argmax(blank)))
            raise TableError(f"{cell}, column {name}: the position is missing; remove such rows")
    table = table.rows(table.answered & np.isfinite([table[name] for name in NEEDED]).all(axis=0))
    if len(table) < LEAST_ROWS:
        raise FitError(
            f"{table.source}: {len(table)} rows with position, slip, torque and load; a map needs "
            f"{LEAST_ROWS} or more"
        )
    place = _places(table, case)
    wheels, wheel = np.unique(
        table["wheel"] if "wheel" in table else np.zeros(len(table)), return_inverse=True
    )
    if len(wheels) > 1 and "time_s" not in table:
        raise TableError(
            f"{table.source}: column time_s is missing; it says which rows of the "
            f"{len(wheels)} wheels belong together"
        )
    time: Floats = table["time_s"] if len(wheels) > 1 else np.arange(float(len(table)))
    station = _stations(table, time, place)
    order = np.argsort(station, kind="stable")
    rows = {"slip": table["slip"], "load": table["load_N"]}
    rows |= {name: table[column(name)] for name in CHANNELS if column(name) in table}
    rows = {name: np.asarray(values, dtype=np.float64)[order] for name, values in rows.items()}
    return MapDrive(rows, place[order], station[order], wheel[order], order, table.source)


def _places(table: Table, case: Case) -> Floats:
    """Places (n, 2) of the contacts, m."""
    place: Floats = np.column_stack([table["x_m"], table["y_m"]])
    if case.rover is None or "wheel" not in table or "heading_rad" not in table:
        return place
    known = case.rover.wheels
    unknown = ~np.isin(table["wheel"], list(known))
    if unknown.any():
        row = int(np.argmax(unknown))
        raise TableError(
            f"{table.place(row)}, column wheel: {str(table['wheel'][row])!r}; wheels of [rover] "
            f"are: {', '.join(known)}"
        )
    heading = table["heading_rad"]
    if not np.isfinite(heading).all():
        row = int(np.argmin(np.isfinite(heading)))
        raise TableError(f"{table.place(row)}, column heading_rad: the cell is blank")
    cos, sin = np.cos(heading), np.sin(heading)
    ahead, left = np.asarray([(known[n].forward, known[n].left) for n in table["wheel"]]).T
    turned = np.column_stack([ahead * cos - left * sin, ahead * sin + left * cos])
    return np.asarray(place + turned)


def _stations(table: Table, time: Floats, place: Floats) -> Floats:
    """Length of the path up to each row, m: of the mean place at its time, and the way ahead of it.

    Raises `TableError` where a step of the path is out of proportion.
    """
    _times, which, count = np.unique(time, return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(which, place[:, k]) / count for k in range(2)])
    step = np.hypot(*np.diff(middle, axis=0).T)
    moved = step[step > 0.0]
    limit = max(JUMP * float(np.median(moved)), LEAST_JUMP) if moved.size else np.inf
    if (step > limit).any():
        number = int(np.argmax(step > limit))
        row = int(np.flatnonzero(which == number + 1)[0])
        raise TableError(
            f"{table.place(row)}: the position jumps by {step[number]:.3g} m, the usual step is "
            f"{np.median(moved):.2g} m; mend x_m and y_m, or map the parts one by one"
        )
    if not moved.size:
        raise TableError(f"{table.source}: x_m and y_m are the same in all rows: there is no path")
    length = np.concatenate([[0.0], np.cumsum(step)])
    along = np.gradient(middle, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    return np.asarray(length[which] + ((place - middle[which]) * along[which]).sum(axis=1))
