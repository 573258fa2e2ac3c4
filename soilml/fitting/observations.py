"""Measured rows for identification: operating points, channels and their noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.errors import FitError
from soilml.fitting.operating_points import operating_points, operating_points_of_rows
from soilml.fitting.rover_rows import with_rover_columns
from soilml.fitting.shared_errors_sizes import declared_errors
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, QUANTITIES, column
from soilml.remarks import Remark

Floats = NDArray[np.float64]

#: Standard deviation, as a fraction of a channel's largest reading, up to which it counts as zero:
#: below any sensor's resolution, and near the rounding errors of a prediction.
LEAST_RELATIVE_STD = 1e-6


@dataclass(frozen=True)
class Channel:
    """Readings of one quantity, NaN where not measured, and their standard deviation."""

    name: str
    reading: Floats
    std: Floats
    declared: bool


@dataclass(frozen=True)
class Condensed:
    """What condensed rows stand for.

    Attributes
    ----------
    rows, readings
        Numbers of measured rows, and of their readings.
    squares
        Sum of the squared distances of the readings from those of their condensed rows, in standard
        deviations of their noise.
    """

    rows: int
    readings: int
    squares: float


@dataclass(frozen=True)
class Observations:
    """Rows (n,): operating points with their noise, and the readings of the channels.

    Attributes
    ----------
    at
        Operating points, arrays (n,).
    slip_std, load_std
        Standard deviations (n,) of slip and of load (N); 0 where not declared.
    channels
        Channels that are fitted.
    excluded_channels
        Columns that are not fitted, since their noise is not declared and that of others is.
    notes
        Remarks on the table.
    shared_errors
        Standard deviations of the errors that all rows share, by name, as [bias] declares them.
    condensed
        What the rows stand for, where many were condensed.
    """

    at: Operating
    slip_std: Floats
    load_std: Floats
    channels: tuple[Channel, ...]
    excluded_channels: tuple[str, ...]
    notes: tuple[Remark, ...] = ()
    shared_errors: Mapping[str, float] = field(default_factory=dict)
    condensed: Condensed | None = None

    @property
    def slip(self) -> Floats:
        """Slip of each row, (n,)."""
        return np.asarray(self.at.slip)

    @property
    def load(self) -> Floats:
        """Load of each row, (n,), N."""
        return np.asarray(self.at.load)

    @property
    def row_count(self) -> int:
        """Number of measured rows."""
        return len(self.slip) if self.condensed is None else self.condensed.rows

    @property
    def reading_count(self) -> int:
        """Number of measured readings of all channels."""
        if self.condensed is not None:
            return self.condensed.readings
        return sum(int(np.isfinite(c.reading).sum()) for c in self.channels)

    @property
    def squares_within(self) -> float:
        """Squared residuals, in standard deviations, that condensed rows no longer show."""
        return 0.0 if self.condensed is None else self.condensed.squares

    def of_rows(self, rows: NDArray[np.int64]) -> Observations:
        """Some of the rows."""
        return replace(
            self,
            at=operating_points_of_rows(self.at, rows),
            condensed=None,
            slip_std=self.slip_std[rows],
            load_std=self.load_std[rows],
            channels=tuple(
                replace(c, reading=c.reading[rows], std=c.std[rows]) for c in self.channels
            ),
        )


def read_observations(case: Case, table: Table) -> Observations:
    """Observations of a case in a table.

    Noise comes from `<column>_std`, else from the case's [noise]. A channel with neither is
    excluded if another channel has one; if none has, all are used and their noise is to be
    estimated. Rows whose status is not ok are excluded.

    Raises
    ------
    TableError
        Where the table names another wheel than the case's.
    FitError
        Where no row or no reading remains, or all standard deviations of a channel are zero.
    """
    table = with_rover_columns(case, table)
    dropped = int(np.count_nonzero(~table.answered))
    if dropped == len(table):
        raise FitError(f"{table.source}: no row has the status ok")
    table = table.rows(table.answered)
    check_wheel_size(case, table)
    notes = _notes(case, table)
    if dropped:
        text = f"{dropped} rows are excluded: their status is not ok"
        notes.append(Remark("rows-excluded", text))
    found = []
    for name in CHANNELS:
        key = column(name)
        if key in table and np.isfinite(table[key]).any():
            std, note = _without_zeros(table, key, declared_std(case, table, key))
            declared = bool(np.isfinite(std[np.isfinite(table[key])]).all())
            found.append(Channel(name, table[key], std, declared))
            notes += note
    if not found:
        raise FitError(f"{table.source}: no reading of {', '.join(map(column, CHANNELS))}")
    used = [c for c in found if c.declared] or found
    excluded = [column(c.name) for c in found if c not in used]
    return Observations(
        at=operating_points(table),
        slip_std=np.nan_to_num(declared_std(case, table, "slip")),
        load_std=np.nan_to_num(declared_std(case, table, "load_N")),
        channels=tuple(used),
        excluded_channels=tuple(excluded),
        notes=tuple(notes),
        shared_errors=declared_errors(case),
    )


def _notes(case: Case, table: Table) -> list[Remark]:
    """Several runs, and grousers that the model lacks."""
    notes: list[Remark] = []
    runs = len(np.unique(table["run"])) if "run" in table else 1
    if runs > 1:
        notes.append(Remark("runs-as-one-soil", f"{runs} runs are fitted as one soil"))
    if case.gears:
        for name in case.gears:
            rows = table.rows(operating_points(table).gear == name) if "gear" in table else table
            notes += _grouser_note(case.of_gear(name), rows, f"the gear {name}")
    else:
        notes += _grouser_note(case, table, "the model")
    return notes


def _grouser_note(case: Case, table: Table, owner: str) -> list[Remark]:
    """Whether the wheel of a table has grousers that the model lacks."""
    lugs = QUANTITIES["grouser_height"].column
    if lugs in table and np.nanmax(table[lugs], initial=0.0) > 0.0:
        height = float(np.nanmax(table[lugs]))
        if not any(effect.name == "grousers" for effect in case.model.effects):
            text = f"{lugs} is {height:g}, but {owner} has no effect grousers"
            return [Remark("grousers-missing", text, ("grousers",))]
    return []


def declared_std(case: Case, table: Table, key: str) -> Floats:
    """Declared standard deviation of a column, (n,): `<column>_std`, else [noise]; else NaN."""
    std = np.full(len(table), np.nan)
    if key in case.noise:
        std = np.broadcast_to(case.noise[key].std(table[key]), std.shape)
    if f"{key}_std" in table:
        own = table[f"{key}_std"]
        std = np.where(np.isfinite(own), own, std)
    return np.asarray(std)


def _without_zeros(table: Table, key: str, std: Floats) -> tuple[Floats, list[Remark]]:
    """Standard deviations with zeros replaced by the median of the others, and a note of that.

    A relative noise is zero at a reading of zero, where the row would have infinite weight. Raises
    `FitError` where all are zero.
    """
    measured = np.isfinite(table[key])
    least = LEAST_RELATIVE_STD * float(np.abs(table[key][measured]).max())
    zero = measured & (std <= least)
    if not zero.any():
        return std, []
    row = int(np.argmax(zero))
    where = f"{table.place(row)}, column {key}"
    others = std[measured & (std > least)]
    if others.size == 0:
        raise FitError(
            f"{where}: standard deviation {std[row]:.3g}, and no row has a larger one; declare one "
            "such as '2 % + 0.05'"
        )
    median = float(np.median(others))
    more = int(zero.sum()) - 1
    note = (
        f"{where}: standard deviation {std[row]:.3g} replaced by the column's median {median:.3g}"
    )
    if more:
        note += f"; {more} more rows likewise"
    return np.where(zero, median, std), [Remark("zero-noise", note, (key,))]
