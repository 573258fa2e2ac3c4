"""Readings that repeat exactly, which the noise of a working sensor does not let happen."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.onboard.set_contract import ABSENT_STD, OPTIONAL_READINGS
from soilml.onboard.tracking.joint_fit import Rows

#: Sensors that can be found stuck. Slip and load are often set, and then constant by intention.
WATCHED = ("torque", *OPTIONAL_READINGS)
#: Exact repetitions in succession after which a sensor is stuck.
REPETITIONS = 2


@dataclass(frozen=True)
class RepeatedReadings:
    """The row before, and how often each watched reading was repeated in succession."""

    previous: Rows | None = None
    times: tuple[int, ...] = (0,) * len(WATCHED)

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
        return RepeatedReadings(
            row,
            tuple(
                times + 1 if _measured(row, n) and row[n][0] == before[n][0] else 0
                for n, times in zip(WATCHED, self.times, strict=True)
            ),
        )

    @property
    def stuck(self) -> str | None:
        """The first sensor that is stuck."""
        names = (n for n, t in zip(WATCHED, self.times, strict=True) if t >= REPETITIONS)
        return next(names, None)


def _measured(row: Rows, name: str) -> bool:
    return bool(row[f"{name}_std"][0] < ABSENT_STD)
