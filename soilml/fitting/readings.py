"""Measured readings of all channels stacked in one vector, with their operating points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.fitting.levels import Levels, load_levels, rows_driven_alike, slip_levels
from soilml.fitting.observations import declared_std
from soilml.fitting.operating_points import gear_numbers, operating_points
from soilml.fitting.rover_rows import with_rover_columns
from soilml.io.table import Table
from soilml.physics.effects.base import REFERENCE_LOAD, log_relative_slip
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Readings that a table may have. The matrices of an analysis are of this size squared, and many
#: are held at a time: 1.1 GB in all.
MOST_READINGS = 3600


@dataclass(frozen=True)
class Readings:
    """Operating points of n rows, and the m readings of all channels in one vector.

    `row` and `channel` are the row and the index in `channels` of each reading; `std` is its
    declared noise, NaN where none is declared, and `sensor_std` the part of it that is not noise of
    slip and load, where these were added.
    """

    at: Operating
    run: Integers  # (n,) index of each row's run in `runs`
    runs: tuple[str, ...]
    order: Integers  # (n,) position of the row in its run, by time
    channels: tuple[str, ...]
    row: Integers  # (m,)
    channel: Integers  # (m,)
    reading: Floats  # (m,)
    std: Floats  # (m,)
    noise: tuple[Noise | None, ...]  # of each channel, where the case declares it
    slip_std: float = 0.0  # declared measurement noise of a slip, 0 where none is declared
    load_std: float = 0.0  # likewise of a load, N
    sensor_std: Floats | None = None  # (m,)

    def __len__(self) -> int:
        return len(self.reading)

    @property
    def slip(self) -> Floats:
        """Slip of each reading, (m,)."""
        return np.asarray(self.at.slip)[self.row]

    @property
    def load(self) -> Floats:
        """Load of each reading, (m,), N."""
        return np.asarray(self.at.load)[self.row]

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
        levels = slip_levels(np.asarray(self.at.slip)[row], self.run[row], self.slip_std)
        return replace(levels, index=levels.index[which])

    @cached_property
    def load_levels(self) -> Levels:
        """Levels of the logarithm of the load; `index` (m,) is that of each reading."""
        row, which = np.unique(self.row, return_inverse=True)
        levels = load_levels(np.asarray(self.at.load)[row], self.run[row], self.load_std)
        return replace(levels, index=levels.index[which])

    @cached_property
    def driven_alike(self) -> Integers:
        """Groups of readings (m,) whose rows are repeats of each other, of all channels."""
        return rows_driven_alike(self.at, self.run, self.slip_std, self.load_std)[self.row]

    @property
    def gear(self) -> Integers:
        """Number of the gear that drove each reading, (m,); 0 where none is named."""
        return gear_numbers(self.at)[self.row]

    def of_rows(self, rows: Integers, at: Operating) -> tuple[NDArray[np.bool_], Readings]:
        """The readings of some rows, whose operating points are `at`, and which they are, (m,)."""
        position = np.full(len(self.run), -1)
        position[rows] = np.arange(rows.size)
        selected = position[self.row] >= 0
        part = self.subset(selected)
        return selected, replace(
            part, at=at, run=self.run[rows], order=self.order[rows], row=position[part.row]
        )

    def stack(self, force: dict[str, Floats]) -> Floats:
        """Values of each channel by row, (..., n), as one vector, (..., m)."""
        stacked = np.stack([force[name] for name in self.channels], axis=-1)
        return np.asarray(stacked[..., self.row, self.channel])

    def subset(self, selected: NDArray[np.bool_]) -> Readings:
        """The selected readings; all rows are retained."""
        return replace(
            self,
            row=self.row[selected],
            channel=self.channel[selected],
            reading=self.reading[selected],
            std=self.std[selected],
            sensor_std=None if self.sensor_std is None else self.sensor_std[selected],
        )

    def with_noise_at(self, expected: Floats) -> Readings:
        """The readings with the noise that is declared for the expected values (m,).

        Noise that is a fraction of the reading itself would give low readings too much weight. A
        standard deviation is at least a thousandth of its channel's median.
        """
        own = self.std if self.sensor_std is None else self.sensor_std
        std = own.copy()
        for i, noise in enumerate(self.noise):
            in_channel = self.channel == i
            if noise is not None:
                std[in_channel] = noise.std(expected[in_channel])
        floor = np.asarray([1e-3 * np.median(own[self.channel == i]) for i in self.channel])
        return replace(self, std=np.maximum(std, floor), sensor_std=None)

    def with_noise_of_operation(self, std: Floats) -> Readings:
        """The readings with noise (m,) in addition that their slip and load cause."""
        return replace(self, std=np.hypot(self.std, std), sensor_std=self.std)

    def with_known_noise(self) -> tuple[Readings, list[str]]:
        """The channels with known noise, if there are any, and notes about the excluded ones."""
        unknown = {int(i) for i in self.channel[~np.isfinite(self.std)]}
        if not unknown or len(unknown) == len(self.channels):
            return self, []
        notes = [
            f"{column(self.channels[i])} is excluded: its noise is not declared and there are no "
            "repeated rows to estimate it from; declare it in [noise], such as "
            f"{column(self.channels[i])} = '3 %'"
            for i in sorted(unknown)
        ]
        kept = [i for i in range(len(self.channels)) if i not in unknown]
        readings = self.subset(np.isin(self.channel, kept))
        index = {old: new for new, old in enumerate(kept)}
        return replace(
            readings,
            channels=tuple(self.channels[i] for i in kept),
            noise=tuple(self.noise[i] for i in kept),
            channel=np.asarray([index[int(i)] for i in readings.channel], dtype=np.int64),
        ), notes

    def with_default_std(self, std: dict[str, float]) -> Readings:
        """The readings with these standard deviations, by channel, where none is declared."""
        default = np.asarray([std.get(self.channels[i], np.nan) for i in self.channel])
        return replace(self, std=np.where(np.isfinite(self.std), self.std, default))


def stack_readings(case: Case, table: Table) -> Readings:
    """All finite readings of the channels that the model predicts, with their declared noise.

    Noise is that of `<column>_std`, else of [noise] in the case; a standard deviation that is not
    positive counts as undeclared.
    """
    table = with_rover_columns(case, table)
    names = tuple(
        name
        for name in CHANNELS
        if column(name) in table and np.isfinite(table[column(name)]).any()
    )
    runs, number = np.unique(table["run"], return_inverse=True)
    time = table["time_s"] if "time_s" in table else np.arange(len(table), dtype=np.float64)
    order = np.zeros(len(table), dtype=np.int64)
    for r in range(len(runs)):
        rows = np.flatnonzero(number == r)
        order[rows[np.argsort(time[rows], kind="stable")]] = np.arange(rows.size)
    row, channel, reading, std = [], [], [], []
    for i, name in enumerate(names):
        values = table[column(name)]
        kept = np.flatnonzero(np.isfinite(values))
        row.append(kept)
        channel.append(np.full(kept.size, i))
        reading.append(values[kept])
        std.append(positive_std(case, table, column(name))[kept])
    return Readings(
        at=operating_points(table),
        run=number.astype(np.int64),
        runs=tuple(str(name) for name in runs),
        order=order,
        channels=names,
        row=np.concatenate(row) if row else np.zeros(0, dtype=np.int64),
        channel=np.concatenate(channel) if channel else np.zeros(0, dtype=np.int64),
        reading=np.concatenate(reading) if reading else np.zeros(0),
        std=np.concatenate(std) if std else np.zeros(0),
        noise=tuple(
            None if f"{column(n)}_std" in table else case.noise.get(column(n)) for n in names
        ),
        slip_std=_typical_std(case, table, "slip"),
        load_std=_typical_std(case, table, "load_N"),
    )


def check_size(table: Table) -> None:
    """Raise `InputError` for more readings than an analysis can hold, with what to leave out."""
    columns = [table[column(name)] for name in CHANNELS if column(name) in table]
    count = sum(int(np.isfinite(values).sum()) for values in columns)
    if count > MOST_READINGS:
        every = -(-count // MOST_READINGS)
        raise InputError(
            f"{table.source}: {count} readings in {len(table)} rows; an analysis takes at most "
            f"{MOST_READINGS}, because its matrices grow with the square of their number: average "
            f"rows that were driven alike, or keep one row, or one run, of {every}"
        )


def positive_std(case: Case, table: Table, key: str) -> Floats:
    """Declared standard deviation of a column, (n,); NaN where it is absent or not positive."""
    std = declared_std(case, table, key)
    return np.where(std > 0, std, np.nan)


def _typical_std(case: Case, table: Table, key: str) -> float:
    """Median of the declared standard deviations of a column; 0 where none is declared."""
    std = positive_std(case, table, key)
    return float(np.nanmedian(std)) if np.isfinite(std).any() else 0.0
