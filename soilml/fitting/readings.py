"""Measured readings of all channels in one vector, with their operating points and their noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.fitting.levels import Levels, load_levels, replicate_rows, slip_levels
from soilml.fitting.operating_points import gear_numbers, operating_points, operating_points_of_rows
from soilml.fitting.shared_errors import declared_errors
from soilml.io.table import Table
from soilml.physics.effects.base import REFERENCE_LOAD, log_relative_slip
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark

Booleans = NDArray[np.bool_]

#: Standard deviation, as a fraction of a channel's largest reading, up to which it counts as zero:
#: below any sensor's resolution, and near the rounding errors of a prediction.
LEAST_RELATIVE_STD = 1e-6
#: Smallest standard deviation at a prediction, as a fraction of the channel's median one.
LEAST_OF_MEDIAN = 1e-3


@dataclass(frozen=True)
class CondensedRows:
    """What condensed rows stand for.

    rows, readings: Numbers of measured rows, and of their readings.
    squares: Sum of the squared distances of the readings from those of their condensed rows, in
        standard deviations of their noise.
    undeclared: Columns whose noise is that of their residuals, since none is declared.
    """

    rows: int
    readings: int
    squares: float
    undeclared: tuple[str, ...] = ()


@dataclass(frozen=True)
class Readings:
    """Operating points of n rows, and the m readings of all channels in one vector.

    Attributes
    ----------
    at
        Operating points, arrays (n,).
    run, runs, order
        Index (n,) of each row's run in `runs`; position (n,) of the row in its run,
        by time.
    channels
        Names of the channels.
    row, channel
        Row, and index in `channels`, of each reading, (m,).
    measured, std
        Measured values (m,), of planned rows the expected ones, and their noise: as
        declared, NaN where it is not; in a fit, as it is taken.
    noise, from_case
        Noise of each channel that the case declares, and of which readings (m,) it is
        the noise; that of others stands in the table.
    slip_std, load_std
        Declared noise of slip and of load (N), (n,); 0 where none is declared.
    sensor_std
        The part (m,) of `std` that is not noise of slip and load, where these were added.
    excluded_channels
        Columns that are not fitted, since their noise is not declared and that of
        others is.
    notes
        Remarks on the table.
    shared_errors
        Standard deviations of the errors that all rows share, by name: as [bias]
        declares them, or with those that sensors and models typically have.
    condensed
        What the rows stand for, where many were condensed.
    """

    at: Operating
    run: Integers
    runs: tuple[str, ...]
    order: Integers
    channels: tuple[str, ...]
    row: Integers
    channel: Integers
    measured: Floats
    std: Floats
    noise: tuple[Noise | None, ...]
    from_case: Booleans
    slip_std: Floats
    load_std: Floats
    sensor_std: Floats | None = None
    excluded_channels: tuple[str, ...] = ()
    notes: tuple[Remark, ...] = ()
    shared_errors: Mapping[str, float] = field(default_factory=dict)
    condensed: CondensedRows | None = None

    @staticmethod
    def of_every_row(
        at: Operating,
        channels: Sequence[str] = CHANNELS,
        measured: Floats | None = None,
        std: Floats | None = None,
        noise: Sequence[Noise | None] | None = None,
        run: Integers | None = None,
        runs: Sequence[str] = ("",),
    ) -> Readings:
        """Readings of all channels at all n rows, one channel after another; NaN by default."""
        n, c = np.broadcast(at.slip, at.load).size, len(channels)
        unknown, exact = np.full(n * c, np.nan), np.zeros(n)
        return Readings(
            at=at,
            run=np.zeros(n, np.int64) if run is None else run,
            runs=tuple(runs),
            order=np.arange(n),
            channels=tuple(channels),
            row=np.tile(np.arange(n), c),
            channel=np.repeat(np.arange(c), n),
            measured=unknown if measured is None else measured,
            std=unknown if std is None else std,
            noise=(None,) * c if noise is None else tuple(noise),
            from_case=np.ones(n * c, bool),
            slip_std=exact,
            load_std=exact,
        )

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def row_slip(self) -> Floats:
        """Slip of each row, (n,)."""
        return np.asarray(self.at.slip, dtype=np.float64)

    @property
    def row_load(self) -> Floats:
        """Load of each row, (n,), N."""
        return np.asarray(self.at.load, dtype=np.float64)

    @property
    def slip(self) -> Floats:
        """Slip of each reading, (m,)."""
        return np.asarray(self.row_slip[self.row])

    @property
    def load(self) -> Floats:
        """Load of each reading, (m,), N."""
        return np.asarray(self.row_load[self.row])

    @property
    def gear(self) -> Integers:
        """Number of the gear that drove each reading, (m,); 0 where none is named."""
        return gear_numbers(self.at)[self.row]

    @property
    def row_count(self) -> int:
        """Number of measured rows."""
        return len(self.row_slip) if self.condensed is None else self.condensed.rows

    @property
    def reading_count(self) -> int:
        """Number of measured readings."""
        return len(self) if self.condensed is None else self.condensed.readings

    @property
    def squares_within(self) -> float:
        """Squared residuals, in standard deviations, that condensed rows no longer show."""
        return 0.0 if self.condensed is None else self.condensed.squares

    @property
    def undeclared(self) -> tuple[str, ...]:
        """Columns of the channels with a reading whose noise is not declared."""
        if self.condensed is not None:
            return self.condensed.undeclared
        unknown = np.unique(self.channel[~np.isfinite(self.std)])
        return tuple(column(self.channels[i]) for i in unknown)

    @property
    def log_slip_and_load(self) -> tuple[Floats, Floats]:
        """Logarithms of slip and load, each (m,), whose coefficients are the shapes of laws.

        They are zero at the slip and load where the size of an effect is its parameter's value.
        """
        return log_relative_slip(self.slip), np.log(self.load / REFERENCE_LOAD)

    @cached_property
    def slip_levels(self) -> Levels:
        """Levels of slip; `index` (m,) is that of each reading."""
        row, which = np.unique(self.row, return_inverse=True)
        levels = slip_levels(self.row_slip[row], self.run[row], typical_std(self.slip_std))
        return replace(levels, index=levels.index[which])

    @cached_property
    def load_levels(self) -> Levels:
        """Levels of the logarithm of the load; `index` (m,) is that of each reading."""
        row, which = np.unique(self.row, return_inverse=True)
        levels = load_levels(self.row_load[row], self.run[row], typical_std(self.load_std))
        return replace(levels, index=levels.index[which])

    @cached_property
    def replicates(self) -> Integers:
        """Groups of readings (m,) whose rows are replicates of each other, of all channels."""
        slip_std, load_std = typical_std(self.slip_std), typical_std(self.load_std)
        return replicate_rows(self.at, self.run, slip_std, load_std)[self.row]

    def of_rows(self, rows: Integers, at: Operating | None = None) -> tuple[Booleans, Readings]:
        """The readings of some rows, and which they are, (m,); `at` are their operating points."""
        position = np.full(len(self.run), -1)
        position[rows] = np.arange(rows.size)
        selected = position[self.row] >= 0
        part = self.subset(selected)
        return selected, replace(
            part,
            at=operating_points_of_rows(self.at, rows) if at is None else at,
            run=self.run[rows],
            order=self.order[rows],
            row=position[part.row],
            slip_std=self.slip_std[rows],
            load_std=self.load_std[rows],
            condensed=None,
        )

    def subset(self, selected: Booleans) -> Readings:
        """The selected readings; all rows are retained."""
        return replace(
            self,
            row=self.row[selected],
            channel=self.channel[selected],
            measured=self.measured[selected],
            std=self.std[selected],
            from_case=self.from_case[selected],
            sensor_std=None if self.sensor_std is None else self.sensor_std[selected],
        )

    def of_channels(self, kept: Sequence[int]) -> Readings:
        """The readings of some channels, by their indices."""
        readings = self.subset(np.isin(self.channel, kept))
        return replace(
            readings,
            channels=tuple(self.channels[i] for i in kept),
            noise=tuple(self.noise[i] for i in kept),
            channel=np.searchsorted(np.asarray(kept), readings.channel).astype(np.int64),
        )

    @cached_property
    def _by_channel(self) -> list[tuple[Integers, Integers]]:
        """Positions of the readings of each channel, and their rows."""
        found = [np.flatnonzero(self.channel == i) for i in range(len(self.channels))]
        return [(own, self.row[own]) for own in found]

    def stack(self, force: Mapping[str, Floats]) -> Floats:
        """Values of each channel by row, (..., n), as one vector, (..., m)."""
        first = force[self.channels[0]] if self.channels else np.zeros(0)
        stacked = np.empty((*first.shape[:-1], len(self)))
        for name, (own, rows) in zip(self.channels, self._by_channel, strict=True):
            stacked[..., own] = force[name][..., rows]
        return stacked

    def noise_at(self, expected: Floats) -> Floats:
        """Standard deviations (..., m) of the sensors where the readings are expected (..., m).

        Noise that is a fraction of the reading itself would give low readings too much weight.
        What the table gives stays as it is, and so does that of readings without an expected
        value. A standard deviation is at least a thousandth of its channel's median.
        """
        own = self.std if self.sensor_std is None else self.sensor_std
        if not any(noise is not None and noise.share > 0.0 for noise in self.noise):
            std = np.broadcast_to(own, expected.shape)
        else:
            std = np.tile(own, (*expected.shape[:-1], 1))
            for i, noise in enumerate(self.noise):
                if noise is not None and noise.share > 0.0:
                    kept = np.flatnonzero(self.from_case & (self.channel == i))
                    there = noise.std(expected[..., kept])
                    std[..., kept] = np.where(there >= 0.0, there, std[..., kept])
        return np.asarray(np.fmax(std, self._least_std))

    @cached_property
    def _least_std(self) -> Floats:
        own = self.std if self.sensor_std is None else self.sensor_std
        least = np.zeros(len(self))
        for positions, _ in self._by_channel:
            if np.isfinite(own[positions]).all() and positions.size:
                least[positions] = LEAST_OF_MEDIAN * np.median(own[positions])
        return np.where(np.isfinite(own), least, np.nan)

    def with_noise_at(self, expected: Floats) -> Readings:
        """The readings with the noise that is declared for the expected values (m,)."""
        return replace(self, std=self.noise_at(expected), sensor_std=None)

    def with_noise_of_operation(self, std: Floats) -> Readings:
        """The readings with noise (m,) in addition that their slip and load cause."""
        return replace(self, std=np.hypot(self.std, std), sensor_std=self.std)

    def with_known_noise(self) -> tuple[Readings, list[Remark]]:
        """The channels with known noise, if there are any, and notes about the excluded ones."""
        unknown = {int(i) for i in self.channel[~np.isfinite(self.std)]}
        if not unknown or len(unknown) == len(self.channels):
            return self, []
        notes = []
        for i in sorted(unknown):
            key = column(self.channels[i])
            text = (
                f"{key} is excluded: its noise is not declared and there are no repeated rows to "
                f"estimate it from; declare it in [noise], such as {key} = '3 %'"
            )
            notes.append(Remark("unused-channel", text, (key,)))
        return self.of_channels([i for i in range(len(self.channels)) if i not in unknown]), notes

    def with_default_std(self, std: Mapping[str, float]) -> Readings:
        """The readings with these standard deviations, by channel, where none is declared."""
        default = np.asarray([std.get(self.channels[i], np.nan) for i in self.channel])
        return replace(self, std=np.where(np.isfinite(self.std), self.std, default))


def stack_readings(case: Case, table: Table) -> Readings:
    """All finite readings of the channels that the model predicts, with their declared noise.

    Noise is that of `<column>_std`, else of [noise] in the case; a standard deviation that is not
    positive counts as undeclared. The table has the columns of `with_rover_columns`.
    """
    names = tuple(n for n in CHANNELS if column(n) in table and np.isfinite(table[column(n)]).any())
    own_runs = table["run"] if "run" in table else np.zeros(len(table), dtype=np.int64)
    runs, number = np.unique(own_runs, return_inverse=True)
    time = table["time_s"] if "time_s" in table else np.arange(len(table), dtype=np.float64)
    order = np.zeros(len(table), dtype=np.int64)
    for r in range(len(runs)):
        rows = np.flatnonzero(number == r)
        order[rows[np.argsort(time[rows], kind="stable")]] = np.arange(rows.size)
    parts: dict[str, list[Any]] = {
        name: [np.zeros(0)] for name in ("row", "channel", "measured", "std", "from_case")
    }
    for i, name in enumerate(names):
        key = column(name)
        kept = np.flatnonzero(np.isfinite(table[key]))
        own = table[f"{key}_std"] if f"{key}_std" in table else np.full(len(table), np.nan)
        parts["row"].append(kept)
        parts["channel"].append(np.full(kept.size, i))
        parts["measured"].append(table[key][kept])
        parts["std"].append(positive_std(case, table, key)[kept])
        parts["from_case"].append(~np.isfinite(own[kept]))
    joined = {name: np.concatenate(own) for name, own in parts.items()}
    return Readings(
        at=operating_points(table),
        run=number.astype(np.int64),
        runs=tuple(str(name) for name in runs),
        order=order,
        channels=names,
        row=joined["row"].astype(np.int64),
        channel=joined["channel"].astype(np.int64),
        measured=joined["measured"],
        std=joined["std"],
        noise=tuple(case.noise.get(column(name)) for name in names),
        from_case=joined["from_case"].astype(bool),
        slip_std=np.nan_to_num(positive_std(case, table, "slip")),
        load_std=np.nan_to_num(positive_std(case, table, "load_N")),
        shared_errors=declared_errors(case),
    )


def declared_std(case: Case, table: Table, key: str) -> Floats:
    """Declared standard deviation of a column, (n,): `<column>_std`, else [noise]; else NaN."""
    std = np.full(len(table), np.nan)
    if key in case.noise:
        std = np.broadcast_to(case.noise[key].std(table[key]), std.shape)
    if f"{key}_std" in table:
        own = table[f"{key}_std"]
        std = np.where(np.isfinite(own), own, std)
    return np.asarray(std)


def positive_std(case: Case, table: Table, key: str) -> Floats:
    """Declared standard deviation of a column, (n,); NaN where it is absent or not positive."""
    std = declared_std(case, table, key)
    return np.where(std > 0, std, np.nan)


def typical_std(std: Floats) -> float:
    """Median of the standard deviations (n,) that are declared; 0 where none is."""
    return float(np.median(std[std > 0.0])) if (std > 0.0).any() else 0.0
