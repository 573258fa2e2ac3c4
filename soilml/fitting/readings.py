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
from soilml.errors import FitError
from soilml.fitting.levels import Levels, load_levels, replicate_rows, slip_levels
from soilml.fitting.operating_points import gear_numbers, operating_points, operating_points_of_rows
from soilml.fitting.shared_errors import declared_errors
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark

Booleans = NDArray[np.bool_]

#: Standard deviation, as a fraction of a channel's largest reading, up to which it counts as zero:
#: below any sensor's resolution, and near the rounding errors of a prediction.
LEAST_RELATIVE_STD = 1e-6
#: Rows of one fit: the noise of more is far below the errors that rows share, and neighbours in a
#: log are not independent.
MOST_FITTED_ROWS = 2000
#: Smallest standard deviation at a prediction, as a fraction of the channel's median one.
LEAST_OF_MEDIAN = 1e-3


@dataclass(frozen=True)
class Readings:
    """Operating points of n rows, and the m readings of all channels in one vector."""

    at: Operating  # arrays (n,)
    run: Integers  # (n,) index of each row's run in `runs`
    runs: tuple[str, ...]
    order: Integers  # (n,) position of each row in its run, by time
    channels: tuple[str, ...]  # names
    row: Integers  # (m,) row of each reading
    channel: Integers  # (m,) its index in `channels`
    measured: Floats  # (m,) measured values, of planned rows the expected ones
    std: Floats  # (m,) their noise: as declared, NaN where it is not; in a fit, as it is taken
    constant: Floats  # (m,) absolute part of the noise of the sensors; NaN where undeclared
    share: Floats  # (m,) their relative part, as a fraction of the expected reading
    slip_std: Floats  # (n,) declared noise; 0 where none is declared
    load_std: Floats  # (n,) likewise, N
    notes: tuple[Remark, ...] = ()  # on the table
    #: Standard deviations of the errors that all rows share, by name: as [bias] declares them, or
    #: with those that sensors and models typically have
    shared_errors: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def of_every_row(
        at: Operating,
        channels: Sequence[str] = CHANNELS,
        measured: Floats | None = None,
        std: Floats | None = None,
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
            constant=unknown if std is None else std,
            share=np.zeros(n * c),
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

    def driven_by(self, unnamed: str) -> NDArray[np.str_]:
        """Name of the gear that drove each reading, (m,); `unnamed` where the rows name none."""
        gear = np.asarray(unnamed if self.at.gear is None else self.at.gear)
        return np.asarray(np.broadcast_to(gear, len(self.run))[self.row])

    @property
    def row_count(self) -> int:
        """Number of rows."""
        return len(self.run)

    @property
    def undeclared(self) -> tuple[str, ...]:
        """Columns of the channels with a reading whose noise is not declared."""
        unknown = np.unique(self.channel[~np.isfinite(self.std)])
        return tuple(column(self.channels[i]) for i in unknown)

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
        )

    def thinned(self) -> Readings:
        """At most `MOST_FITTED_ROWS` rows: as many of each gear, run and load, or all of few."""
        if self.row_count <= MOST_FITTED_ROWS:
            return self
        load = load_levels(self.row_load, self.run, typical_std(self.load_std)).index
        kinds = np.stack([gear_numbers(self.at), self.run, load])
        rows = even_part(np.unique(kinds, axis=1, return_inverse=True)[1].ravel(), MOST_FITTED_ROWS)
        text = (
            f"{len(rows)} of {self.row_count} rows are fitted, spread evenly over runs and loads: "
            "more would tell little beside the errors that all rows share"
        )
        notes = (*self.notes, Remark("rows-thinned", text, severity="note"))
        return replace(self.of_rows(rows)[1], notes=notes)

    def subset(self, selected: Booleans) -> Readings:
        """The selected readings; all rows are retained."""
        return replace(
            self,
            row=self.row[selected],
            channel=self.channel[selected],
            measured=self.measured[selected],
            std=self.std[selected],
            constant=self.constant[selected],
            share=self.share[selected],
        )

    def of_channels(self, kept: Sequence[int]) -> Readings:
        """The readings of some channels, by their indices."""
        readings = self.subset(np.isin(self.channel, kept))
        return replace(
            readings,
            channels=tuple(self.channels[i] for i in kept),
            channel=np.searchsorted(np.asarray(kept), readings.channel).astype(np.int64),
        )

    @cached_property
    def _by_channel(self) -> list[Integers]:
        """Positions of the readings of each channel."""
        return [np.flatnonzero(self.channel == i) for i in range(len(self.channels))]

    def stack(self, force: Mapping[str, Floats]) -> Floats:
        """Values of each channel by row, (..., n), as one vector, (..., m)."""
        first = force[self.channels[0]] if self.channels else np.zeros(0)
        stacked = np.empty((*first.shape[:-1], len(self)))
        for name, own in zip(self.channels, self._by_channel, strict=True):
            stacked[..., own] = force[name][..., self.row[own]]
        return stacked

    def noise_at(self, expected: Floats) -> Floats:
        """Standard deviations (..., m) of the sensors where the readings are expected (..., m).

        Noise that is a fraction of the reading itself would give low readings too much weight.
        What the table gives stays as it is, and so does that of readings without an expected
        value. A standard deviation is at least a thousandth of its channel's median.
        """
        there = np.sqrt(self.constant**2 + (self.share * expected) ** 2)
        std = np.where(there >= 0.0, there, self._declared_std)
        return np.asarray(np.fmax(std, self._least_std))

    @cached_property
    def _declared_std(self) -> Floats:
        return np.sqrt(self.constant**2 + (self.share * self.measured) ** 2)

    @cached_property
    def _least_std(self) -> Floats:
        own, least = self._declared_std, np.zeros(len(self))
        for positions in self._by_channel:
            if np.isfinite(own[positions]).all() and positions.size:
                least[positions] = LEAST_OF_MEDIAN * np.median(own[positions])
        return np.where(np.isfinite(own), least, np.nan)

    def with_noise_at(self, expected: Floats) -> Readings:
        """The readings with the noise that is declared for the expected values (m,)."""
        return replace(self, std=self.noise_at(expected))

    def with_noise_of_operation(self, std: Floats) -> Readings:
        """The readings with noise (m,) in addition that their slip and load cause."""
        return replace(self, std=np.hypot(self.std, std))

    def with_known_noise(self) -> Readings:
        """The channels with known noise, if there are any, with notes about the others."""
        unknown = self.undeclared
        kept = [i for i, name in enumerate(self.channels) if column(name) not in unknown]
        if not unknown or not kept:
            return self
        text = (
            "{0} is not used: its noise is not declared, nor do repeated rows tell it; declare it "
            "in [noise], such as {0} = '3 %'"
        )
        notes = [Remark("unused-channel", text.format(key), (key,)) for key in unknown]
        return replace(self.of_channels(kept), notes=(*self.notes, *notes))

    def with_default_std(self, std: Mapping[str, float]) -> Readings:
        """The readings with these standard deviations, by channel, where none is declared."""
        default, known = np.asarray([*map(std.get, self.channels)], float), np.isfinite(self.std)
        own, constant = (
            np.where(known, x, default[self.channel]) for x in (self.std, self.constant)
        )
        return replace(self, std=own, constant=constant)


def stack_readings(case: Case, table: Table, *, refuse_zeros: bool = False) -> Readings:
    """All finite readings of the channels that the model predicts, with their declared noise.

    Noise is that of `<column>_std`, else of [noise] in the case. A standard deviation of zero,
    which a relative noise has at a reading of zero, is replaced by the median of the others, with a
    note. Where all of a channel are zero they stay, and one that is not positive counts as
    undeclared; with `refuse_zeros` they raise `FitError`. The table has the columns of
    `with_rover_columns`.
    """
    names = tuple(n for n in CHANNELS if column(n) in table and np.isfinite(table[column(n)]).any())
    own_runs = table["run"] if "run" in table else np.zeros(len(table), dtype=np.int64)
    runs, number = np.unique(own_runs, return_inverse=True)
    time = table["time_s"] if "time_s" in table else np.arange(len(table), dtype=np.float64)
    order = np.zeros(len(table), dtype=np.int64)
    for r in range(len(runs)):
        rows = np.flatnonzero(number == r)
        order[rows[np.argsort(time[rows], kind="stable")]] = np.arange(rows.size)
    found: list[tuple[NDArray[Any], ...]] = [(np.zeros(0),) * 6]
    notes: list[Remark] = []
    for i, name in enumerate(names):
        key = column(name)
        kept = np.flatnonzero(np.isfinite(table[key]))
        measured = table[key][kept]
        own = table[f"{key}_std"][kept] if f"{key}_std" in table else np.full(kept.size, np.nan)
        std = declared_std(case, table, key)[kept]
        zero = std <= LEAST_RELATIVE_STD * float(np.abs(measured).max())
        if zero.any():
            std, note = _without_zeros(std, zero, table, kept, key, refuse_zeros)
            notes += note
        noise, by_case = case.noise.get(key, Noise()), ~np.isfinite(own) & ~zero & np.isfinite(std)
        constant = np.where(by_case, noise.constant, std)
        share = np.where(by_case, noise.share, 0.0)
        found.append((kept, np.full(kept.size, i), measured, std, constant, share))
    row, channel, measured, std, constant, share = map(np.concatenate, zip(*found, strict=True))
    return Readings(
        at=operating_points(table),
        run=number.astype(np.int64),
        runs=tuple(str(name) for name in runs),
        order=order,
        channels=names,
        row=row.astype(np.int64),
        channel=channel.astype(np.int64),
        measured=measured,
        std=std,
        constant=constant,
        share=share,
        slip_std=np.nan_to_num(positive_std(case, table, "slip")),
        load_std=np.nan_to_num(positive_std(case, table, "load_N")),
        shared_errors=declared_errors(case),
        notes=tuple(notes),
    )


def _without_zeros(
    std: Floats, zero: Booleans, table: Table, rows: Integers, key: str, refuse: bool
) -> tuple[Floats, list[Remark]]:
    """Standard deviations (m,) with the median of the others where they are zero, and a note."""
    first = int(np.argmax(zero))
    found = f"{table.place(int(rows[first]))}, column {key}: standard deviation {std[first]:.3g}"
    others = std[~zero & np.isfinite(std)]
    if others.size == 0 and refuse:
        raise FitError(f"{found}, and no row has a larger one; declare one such as '2 % + 0.05'")
    if others.size == 0:
        return np.where(std > 0.0, std, np.nan), []
    median, more = float(np.median(others)), int(zero.sum()) - 1
    text = f"{found} replaced by the column's median {median:.3g}"
    text += f"; {more} more rows likewise" if more else ""
    return np.where(zero, median, std), [Remark("zero-noise", text, (key,))]


def even_part(group: Integers, most: int) -> Integers:
    """At most so many of n items: as many of each group (n,), or all of few, spread over it.

    Of more groups than that, the items are taken as one. An item is drawn at random from each of as
    many stretches, so that none of a repeated pattern is missed.
    """
    size = np.bincount(group)
    least, above = 0, int(size.max()) + 1
    while above - least > 1:
        middle = (least + above) // 2
        fits = np.minimum(size, middle).sum() <= most
        least, above = (middle, above) if fits else (least, middle)
    if least == 0:
        return even_part(np.zeros_like(group), most)
    draws, chosen = np.random.default_rng(0), []
    for own in np.split(np.argsort(group, kind="stable"), np.cumsum(size)[:-1]):
        count = min(len(own), least)
        ends = np.arange(count + 1) * len(own) // max(count, 1)
        chosen.append(own[draws.integers(ends[:-1], ends[1:])])
    return np.sort(np.concatenate(chosen))


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
