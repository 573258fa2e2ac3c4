"""Measured rows as identification takes them: operating points, channels, and their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.compatibility import check_wheel_size
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, QUANTITIES, column

Floats = NDArray[np.float64]

#: Share of a channel's largest reading below which a standard deviation is not believed.
LEAST_STD = 1e-6


@dataclass(frozen=True)
class Channel:
    """Readings of one quantity, NaN where not measured, and their standard deviation."""

    name: str
    reading: Floats
    std: Floats
    declared: bool


@dataclass(frozen=True)
class Observations:
    """Rows (n,): how they were driven, the noise of that, and what is to be explained."""

    at: Operating
    slip_std: Floats
    load_std: Floats
    channels: tuple[Channel, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def slip(self) -> Floats:
        """Slip of each row, (n,)."""
        return np.asarray(self.at.slip)

    @property
    def load(self) -> Floats:
        """Load of each row, (n,), N."""
        return np.asarray(self.at.load)

    @property
    def cells(self) -> int:
        """How many readings there are."""
        return sum(int(np.isfinite(c.reading).sum()) for c in self.channels)


def read_observations(case: Case, table: Table) -> Observations:
    """What a table holds for a case; raises `TableError` for a wheel that is not the case's.

    Noise comes from `<column>_std`, else from [noise]. A channel for which neither speaks is left
    out if another is declared; if none is, all are used and their noise is estimated. Rows that
    have no answer by their status are left out. Raises `FitError` where nothing is left.
    """
    dropped = int(np.count_nonzero(~table.answered))
    if dropped == len(table):
        raise FitError(f"{table.source}: no row has the status ok")
    table = table.rows(table.answered)
    check_wheel_size(case, table)
    notes = _notes(case, table)
    if dropped:
        notes.append(f"{dropped} rows are left out: their status is not ok")
    found = []
    for name in CHANNELS:
        key = column(name)
        if key in table and np.isfinite(table[key]).any():
            std, note = _believed(table, key, _declared(case, table, key))
            declared = bool(np.isfinite(std[np.isfinite(table[key])]).all())
            found.append(Channel(name, table[key], std, declared))
            notes += note
    if not found:
        raise FitError(f"{table.source}: no reading of {', '.join(map(column, CHANNELS))}")
    used = [c for c in found if c.declared] or found
    left_out = [column(c.name) for c in found if c not in used]
    return Observations(
        at=operating_points(table),
        slip_std=np.nan_to_num(_declared(case, table, "slip")),
        load_std=np.nan_to_num(_declared(case, table, "load_N")),
        channels=tuple(used),
        left_out=tuple(left_out),
        notes=tuple(notes),
    )


def _notes(case: Case, table: Table) -> list[str]:
    """What a user may have overlooked in the table."""
    said = []
    runs = len(np.unique(table["run"])) if "run" in table else 1
    if runs > 1:
        said.append(f"{runs} runs are taken for one soil")
    lugs = QUANTITIES["grouser_height"].column
    if lugs in table and np.nanmax(table[lugs], initial=0.0) > 0.0:
        height = float(np.nanmax(table[lugs]))
        if not any(effect.name == "grousers" for effect in case.model.effects):
            said.append(f"{lugs} is {height:g}, but the model has no effect grousers")
    return said


def _declared(case: Case, table: Table, key: str) -> Floats:
    """Standard deviation of each reading of a column; NaN where nobody says."""
    std = np.full(len(table), np.nan)
    if key in case.noise:
        std = np.broadcast_to(case.noise[key].std(table[key]), std.shape)
    if f"{key}_std" in table:
        own = table[f"{key}_std"]
        std = np.where(np.isfinite(own), own, std)
    return np.asarray(std)


def _believed(table: Table, key: str, std: Floats) -> tuple[Floats, list[str]]:
    """Standard deviations that may be divided by, and what was said to replace some.

    A share of a reading of zero is zero, and one row would decide everything: the median of the
    column's others is taken there. Raises `FitError` where there are no others.
    """
    measured = np.isfinite(table[key])
    least = LEAST_STD * float(np.abs(table[key][measured]).max())
    tiny = measured & (std <= least)
    if not tiny.any():
        return std, []
    row = int(np.argmax(tiny))
    given = f"{table.place(row)}, column {key}: a standard deviation of {std[row]:.3g}"
    others = std[measured & (std > least)]
    if others.size == 0:
        raise FitError(f"{given}, and no row has a larger one; give one such as '2 % + 0.05'")
    median = float(np.median(others))
    more = int(tiny.sum()) - 1
    said = f"{given} is not believed{f', nor {more} more' if more else ''}: "
    return np.where(tiny, median, std), [f"{said}{median:.3g}, the median of the others, is taken"]
