"""Rows that disagree with those before: glitches, or the first ones of another soil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.onboard.tracking.joint_fit import Rows

#: Rows after which one that disagreed is a glitch.
MOST_ROWS = 8
#: Rows that must disagree with those before, and agree with each other, for another soil.
LEAST_ROWS = 3
#: Rows in succession that disagree with those before, after which these are given up even if the
#: new ones do not agree with each other.
GIVE_UP_AFTER = 25


@dataclass(frozen=True)
class RowsInQuestion:
    """The last rows since the first of them that disagreed with those before.

    Parameters
    ----------
    rows : tuple of Rows
        At most `MOST_ROWS` rows.
    disagree : tuple of bool
        Whether each of them disagrees; the first does.
    in_succession : int
        Rows without one that agrees, up to now.
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
