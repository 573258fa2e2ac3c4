"""Remarks on tables of runs that look as if a unit, a sign or the radius were wrong.

Nothing here is impossible. What is impossible, such as a slip of 2, is refused where the table is
read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError, MissingLibraryError
from soilml.fitting.coordinates import select_free
from soilml.fitting.misfit import declared_misfit
from soilml.fitting.operating_points import with_rover_columns
from soilml.fitting.usable_readings import usable_readings
from soilml.io.read_table import ONE_RUN
from soilml.io.table import Table
from soilml.log_import.channels.inputs import our_slip
from soilml.log_import.checks.row_checks import hints_of
from soilml.log_import.checks.slip_checks import RowsToCheck
from soilml.log_import.mapping.channel_map import SLIP_DEFINITIONS
from soilml.quantities import COLUMNS, QUANTITIES
from soilml.remarks import Remark

#: Logarithm of the ratio of likelihoods of two definitions that is worth asking at: odds of 150.
_DECISIVE = 5.0
_LEAST_ROWS, _ROWS = 6, 48  # Fewest and most rows that are fitted


def table_hints(columns: Mapping[str, Floats], radius: Floats | float | None) -> list[Remark]:
    """Hints at columns in a wrong unit or with a wrong sign, causes before consequences.

    columns: Columns (rows,) of a table of runs by name: `slip`, `load_N`, `torque_Nm`, ...
    radius: Radius of the wheel of all rows or of each row (rows,), m; None where it is not known.

    Examples
    --------
    >>> import numpy as np
    >>> slip, load = np.array([0.1, 0.3, 0.5]), np.full(3, 60.0)
    >>> table_hints({"slip": slip, "load_N": load, "torque_Nm": np.array([1.5, 3, 4])}, 0.15)
    []
    >>> wrong = {"slip": slip, "load_N": load / 9.81, "torque_Nm": np.array([1.5, 3, 4])}
    >>> [(hint.code, hint.about) for hint in table_hints(wrong, 0.15)]
    [('traction-out-of-range', ('torque_Nm', 'load_N'))]
    """
    rows = {COLUMNS[n].name: v for n, v in columns.items() if n in COLUMNS and v.dtype.kind == "f"}
    return [
        Remark(hint.code, hint.text, tuple(QUANTITIES[name].column for name in hint.about))
        for hint in hints_of(RowsToCheck(rows, radius))
    ]


def table_remarks(table: Table, case: Case | None, radius: float | None = None) -> list[Remark]:
    """A remark for each oddity of a table; see `table_hints` and `other_definition_fits`.

    The radius of the wheel (m) is that of the case, else `radius`; None where it is not known.
    """
    used = table.rows(table.answered)
    if case is not None and case.gears:
        used = with_rover_columns(case, used)
    radii = radius if case is None else _radii(used, case)
    if not len(used):
        return []
    hints = table_hints(used.columns, radii)
    if "run" in used and set(used["run"].tolist()) == {ONE_RUN}:
        text = "column run is missing: all rows are taken as one run, measured on one soil"
        hints.append(Remark("no-runs", text, ("run",), "note"))
    told = any(hint.code == "slip-definition" for hint in hints)
    if case is not None and not case.gears and not told and other_definition_fits(case, used):
        text = (
            "the rows fit the model far better where slip is read as (r omega - v)/v: how was it "
            "defined? Needed is 1 - v/(r omega), which is 0.5 where the rim goes twice as far as "
            "the wheel travels; (r omega - v)/v is 1 there"
        )
        hints.append(Remark("slip-definition", text, ("slip",)))
    return [replace(hint, text=f"{table.source}: {hint.text}") for hint in hints]


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


def other_definition_fits(case: Case, table: Table) -> bool:
    """Whether a case explains rows far better where their slip is taken as (r omega - v)/v.

    Asked only of rows that the case does not explain within the declared noise as they are. Both
    fits have the same parameters: with S the sum of squared residuals and f the degrees of
    freedom, f/2 log(S / S') is the logarithm of the ratio of their likelihoods at noise of the size
    that each needs. Of several runs the longest is asked, as its rows are on one soil; rows beyond
    `_ROWS` are thinned out evenly.
    """
    if "run" in table:
        table = max((rows for _, rows in table.groups("run")), key=len)
    if len(table) < _LEAST_ROWS:
        return False
    rows = table.rows(np.unique(np.linspace(0, len(table) - 1, _ROWS).round().astype(int)))
    try:
        free = select_free(case, None)
        readings = usable_readings(case, rows)
        stated = declared_misfit(case, readings, free)
        if stated is None or not stated.exceeds_noise:
            return False
        columns = {**rows.columns, "slip": our_slip(rows["slip"], SLIP_DEFINITIONS[2])}
        other = declared_misfit(case, usable_readings(case, Table(columns)), free)
    except (FitError, InputError, MissingLibraryError):
        return False  # among others where an estimate is made on board, without scipy
    if other is None or stated.freedom < 1:
        return False
    return 0.5 * stated.freedom * float(np.log(stated.squares / other.squares)) > _DECISIVE
