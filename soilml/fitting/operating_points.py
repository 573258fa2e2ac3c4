"""How the rows of a table were driven, and with which gear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.model_settings import UNNAMED_GEAR
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
    """The rows that one of several gears drove.

    Attributes
    ----------
    case
        The case of this gear alone.
    rows
        Positions (k,) of its rows among all.
    at
        Their operating points.
    paths
        Path in `case` of each parameter of the whole case that acts on this gear.
    """

    case: Case
    rows: NDArray[np.int64]
    at: Operating
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
