"""How a slip was defined, by the speeds of rim and travel beside it or by the fit of a case."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError, MissingLibraryError
from soilml.fitting.coordinates import select_free
from soilml.fitting.misfit import declared_misfit
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.log_import.channels.inputs import our_slip
from soilml.log_import.channels.wheel_quantities import slip_ratio
from soilml.log_import.mapping.channel_map import SLIP_DEFINITIONS

#: Fewest rows that tell, and the least difference of slip that is worth telling.
_FEWEST, _LEAST = 4, 0.02
#: Another definition must fit the speeds so many times better than the stated one.
_BETTER = 2.0
#: Logarithm of the ratio of likelihoods of two definitions that is worth asking at: odds of 150.
_DECISIVE = 5.0
_LEAST_ROWS, _ROWS = 6, 48  # Fewest and most rows that are fitted


def definition_by_speeds(
    slip: Floats, rim: Floats, travel: Floats, stated: str = SLIP_DEFINITIONS[0]
) -> tuple[str, str] | None:
    """Definition and unit ("" or "%") by which slip agrees with the speeds; None for the stated.

    slip: As 1 - v/(r omega), (rows,), where it was defined as `stated`.
    rim, travel: Speeds (rows,), m/s, in the sensors' own direction.

    The distance of a definition from the speeds is the median over the rows of the difference of
    slip. It replaces the stated one where that is `_LEAST` or more off, and `_BETTER` times as far.
    """
    direction = np.where(rim < 0.0, -1.0, 1.0)
    by_speeds = slip_ratio(direction * rim, direction * travel)
    good = np.isfinite(slip) & np.isfinite(by_speeds) & (np.abs(by_speeds) < 1.0)
    if good.sum() < _FEWEST:
        return None
    given = _as_logged(slip[good], stated)
    distance = {
        (name, unit): float(np.median(np.abs(our_slip(scale * given, name) - by_speeds[good])))
        for name in SLIP_DEFINITIONS
        for unit, scale in (("", 1.0), ("%", 0.01))
    }
    best = min(distance, key=lambda key: distance[key])
    off = distance[stated, ""]
    return best if off > _LEAST and off > _BETTER * distance[best] else None


def _as_logged(slip: Floats, definition: str) -> Floats:
    """The inverse of `our_slip`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if definition == SLIP_DEFINITIONS[1]:
            return np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
        if definition == SLIP_DEFINITIONS[2]:
            return np.where(slip > 0.0, slip / (1.0 - slip), slip)
    return slip


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
