"""Measured cells: every reading of every channel, with what it was measured under."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
#: A value counts as another one if it differs by this share of the range.
DISTINCT = 0.02


@dataclass(frozen=True)
class Cells:
    """Rows (n,) as driven, and the readings (m,) taken in them, channel by channel.

    `row` says in which row a reading was taken and `channel` which of `channels` it is; `std` is
    its declared noise, NaN where nothing is declared.
    """

    at: Operating
    run: Integers  # (n,) number of the run of each row
    runs: tuple[str, ...]
    order: Integers  # (n,) place of the row in its run
    channels: tuple[str, ...]
    row: Integers  # (m,)
    channel: Integers  # (m,)
    reading: Floats  # (m,)
    std: Floats  # (m,)
    noise: tuple[Noise | None, ...]  # of each channel, where the case declares it

    def __len__(self) -> int:
        return len(self.reading)

    @property
    def slip(self) -> Floats:
        """Slip of each cell, (m,)."""
        return np.asarray(self.at.slip)[self.row]

    @property
    def load(self) -> Floats:
        """Load of each cell, (m,), N."""
        return np.asarray(self.at.load)[self.row]

    def of(self, force: dict[str, Floats]) -> Floats:
        """Channels (..., n) as cells (..., m)."""
        stacked = np.stack([force[name] for name in self.channels], axis=-1)
        return np.asarray(stacked[..., self.row, self.channel])

    def keeping(self, cells: NDArray[np.bool_]) -> Cells:
        """These cells alone; rows stay."""
        return replace(
            self,
            row=self.row[cells],
            channel=self.channel[cells],
            reading=self.reading[cells],
            std=self.std[cells],
        )

    def expecting(self, expected: Floats) -> Cells:
        """The same cells with the noise that expected readings (m,) have.

        A share of the reading itself would give low readings too much weight.
        """
        std = self.std.copy()
        for i, noise in enumerate(self.noise):
            here = self.channel == i
            if noise is not None:
                std[here] = noise.std(expected[here])
        floor = np.asarray([1e-3 * np.median(self.std[self.channel == i]) for i in self.channel])
        return replace(self, std=np.maximum(std, floor))

    def declared(self) -> tuple[Cells, list[str]]:
        """The channels whose noise is known, if there is one, and what was left out in words."""
        unknown = {int(i) for i in self.channel[~np.isfinite(self.std)]}
        if not unknown or len(unknown) == len(self.channels):
            return self, []
        said = [
            f"{column(self.channels[i])} is left out: its noise is not declared and no rows were "
            "driven alike"
            for i in sorted(unknown)
        ]
        kept = [i for i in range(len(self.channels)) if i not in unknown]
        cells = self.keeping(np.isin(self.channel, kept))
        place = {old: new for new, old in enumerate(kept)}
        return replace(
            cells,
            channels=tuple(self.channels[i] for i in kept),
            noise=tuple(self.noise[i] for i in kept),
            channel=np.asarray([place[int(i)] for i in cells.channel], dtype=np.int64),
        ), said

    def with_noise(self, std: dict[str, float]) -> Cells:
        """The same cells with these constant standard deviations where none was declared."""
        own = np.asarray([std.get(self.channels[i], np.nan) for i in self.channel])
        return replace(self, std=np.where(np.isfinite(self.std), self.std, own))


def cells_of(case: Case, table: Table) -> Cells:
    """Every reading of a channel that the model predicts, with its declared noise.

    Noise comes from `<column>_std`, else from [noise] of the case.
    """
    names = tuple(name for name in CHANNELS if column(name) in table and _any(table[column(name)]))
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
        std.append(declared_std(case, table, column(name))[kept])
    return Cells(
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
    )


def declared_std(case: Case, table: Table, key: str) -> Floats:
    """Declared noise of a column, (n,), NaN where there is none."""
    std = np.full(len(table), np.nan)
    if f"{key}_std" in table:
        std = table[f"{key}_std"].copy()
    if key in case.noise:
        std = np.where(np.isfinite(std), std, case.noise[key].std(table[key]))
    return np.where(std > 0, std, np.nan)


def _any(values: Floats) -> bool:
    return bool(np.isfinite(values).any())


def distinct(values: Floats) -> int:
    """How many values there are, those within a fiftieth of the range counted as one."""
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    span = float(ordered[-1] - ordered[0])
    if span <= 1e-9 * max(1.0, abs(float(ordered[-1]))):
        return 1
    count, last = 1, ordered[0]
    for value in ordered:
        if value - last > DISTINCT * span:
            count, last = count + 1, value
    return count
