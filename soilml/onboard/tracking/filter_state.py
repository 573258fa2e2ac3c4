"""State of a tracker: rows in question, readings that repeat, and the window remembered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from soilml.onboard.set_contract import ABSENT_STD, OPERATING_NOISE, OPTIONAL_READINGS
from soilml.onboard.tracking.misfit import Rows
from soilml.onboard.tracking.row_window import LEAST_ROWS, RowWindow

MOST_ROWS = 8  # Rows after which one that disagreed is a glitch
#: Rows in succession that disagree with those before, after which these are given up even if the
#: new ones do not agree with each other.
GIVE_UP_AFTER = 25
#: Sensors that can be found stuck: those of torque, sinkage and pull, and those of slip and load
#: where they have noise and have changed in `ALIVE_AFTER` rows in succession. Otherwise they may be
#: set, and constant by intention.
WATCHED = ("torque", *OPTIONAL_READINGS, *OPERATING_NOISE)
#: Exact repetitions in succession after which a sensor is stuck.
REPETITIONS = 2
#: Rows in succession, each with another reading than the row before, after which a slip or load is
#: known to be a sensor's. A glitch or two in a load that is set are fewer.
ALIVE_AFTER = 8


@dataclass(frozen=True)
class RowsInQuestion:
    """The last rows since the first of them that disagreed with those before.

    rows: At most `MOST_ROWS` rows.
    disagree: Whether each of them disagrees; the first does.
    in_succession: Rows without one that agrees, up to now.
    """

    rows: tuple[Rows, ...] = ()
    disagree: tuple[bool, ...] = ()
    in_succession: int = 0

    @property
    def count(self) -> int:
        """Rows that disagree."""
        return sum(self.disagree)

    def with_row(self, row: Rows, disagrees: bool) -> RowsInQuestion:
        """These rows and another one."""
        rows, flags = (*self.rows, row)[-MOST_ROWS:], (*self.disagree, disagrees)[-MOST_ROWS:]
        first = flags.index(True) if any(flags) else len(flags)
        return RowsInQuestion(
            rows[first:], flags[first:], self.in_succession + 1 if disagrees else 0
        )

    def without_reading(self, name: str, value: float) -> RowsInQuestion:
        """These rows without those of one reading, which proved to be stuck."""
        found = RowsInQuestion()
        for row, disagrees in zip(self.rows, self.disagree, strict=True):
            if row[name][0] != value:
                found = found.with_row(row, disagrees)
        return found

    def candidates(self) -> list[Rows]:
        """Rows (m,) that may be the first of another soil: all, and the last ones.

        The last ones are those since the last row that agreed with the rows before, as rows of
        another soil do at some slips and loads.
        """
        if self.count < LEAST_ROWS:
            return []
        last = min(self.in_succession, len(self.rows))
        if last == len(self.rows):
            last = LEAST_ROWS
        lengths = {len(self.rows), last} if last >= LEAST_ROWS else {len(self.rows)}
        return [joined(self.rows[-n:]) for n in sorted(lengths, reverse=True)]


def joined(rows: Sequence[Rows]) -> Rows:
    """Several rows as one set of row inputs."""
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


@dataclass(frozen=True)
class RepeatedReadings:
    """The row before, and how often each watched reading was repeated in succession.

    times: Repetitions in succession of each of `WATCHED`.
    changes: Rows in succession that changed it; once `ALIVE_AFTER`, so for good.
    """

    previous: Rows | None = None
    times: tuple[int, ...] = (0,) * len(WATCHED)
    changes: tuple[int, ...] = (0,) * len(WATCHED)

    def repeats(self, row: Rows) -> bool:
        """Whether a row is the row before once more."""
        before = self.previous
        return before is not None and all(
            row[n][0] == before[n][0] for n in ("slip", "load", *WATCHED)
        )

    def with_row(self, row: Rows) -> RepeatedReadings:
        """The counts after another row."""
        before = self.previous
        if before is None:
            return RepeatedReadings(row)
        # a wheel that stands repeats its slip and torque, whatever the load does
        if not (row["slip"][0] or row["torque"][0]):
            return RepeatedReadings(row, changes=self.changes)
        equal = [bool(row[n][0] == before[n][0]) for n in WATCHED]
        return RepeatedReadings(
            row,
            tuple(
                min(times + 1, REPETITIONS) if same and _measured(row, n) else 0
                for n, times, same in zip(WATCHED, self.times, equal, strict=True)
            ),
            tuple(
                count if count == ALIVE_AFTER else 0 if same else count + 1
                for count, same in zip(self.changes, equal, strict=True)
            ),
        )

    @property
    def stuck(self) -> str | None:
        """The first sensor that is stuck."""
        for name, times, changes in zip(WATCHED, self.times, self.changes, strict=True):
            alive = changes == ALIVE_AFTER or name not in OPERATING_NOISE
            if times == REPETITIONS and alive:
                return name
        return None


def _measured(row: Rows, name: str) -> bool:
    std = float(row[f"{name}_std"][0]) if f"{name}_std" in row else 0.0
    return 0.0 < std < ABSENT_STD


@dataclass(frozen=True)
class FilterState:
    """State of a tracker after a row.

    window: The rows that the estimate rests on.
    question: Rows that may be of another soil.
    repeated: Which readings repeat.
    increases: What each of the last rows added to the misfit, over its median for sound rows.
    rows_since_change: Rows used since the soil changed.
    rows_since_drift: Rows used since a drift was last found; -1: never, on this soil.
    variance: Variance of the noise that the rows show, over that stated, 1 or more.
    """

    window: RowWindow
    question: RowsInQuestion = field(default_factory=RowsInQuestion)
    repeated: RepeatedReadings = field(default_factory=RepeatedReadings)
    increases: tuple[float, ...] = ()
    rows_since_change: int = 0
    rows_since_drift: int = -1
    variance: float = 1.0
