"""Hints at columns of a table of runs that look as if a unit or a sign were wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.table import Table
from soilml.log_import.checks.table_hints import table_hints


def table_remarks(table: Table, case: Case | None, radius: float | None = None) -> list[str]:
    """A line for each oddity of a table; see `table_hints`.

    The radius of the wheel (m) is that of the case, else `radius`; None where it is not known.
    """
    used = table.rows(table.answered)
    if case is not None and case.gears:
        used = with_rover_columns(case, used)
    radii = radius if case is None else _radii(used, case)
    if not len(used):
        return []
    return [f"{table.source}: {hint}" for hint in table_hints(used.columns, radii)]


def _radii(table: Table, case: Case) -> NDArray[np.float64] | None:
    """Radius of each row, (rows,), m; None for a gear without a radius."""
    if not case.gears:
        radius = getattr(case.model.gear, "radius", None)
        return None if radius is None else np.full(len(table), float(radius))
    first = next(iter(case.gears))
    names = table["gear"] if "gear" in table else np.full(len(table), first)
    radii = {name: getattr(model.gear, "radius", None) for name, model in case.gears.items()}
    found = [radii.get(str(name) or first) for name in names]
    return None if any(r is None for r in found) else np.asarray(found, dtype=np.float64)
