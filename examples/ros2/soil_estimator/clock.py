"""Samples of one quantity by the stamp of their message, with a check of the clock behind it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

#: Samples in succession that must agree on another time before a clock counts as set anew.
CONFIRMED_BY = 3


class Stamp(Enum):
    """What became of a sample."""

    USED = "used"
    REPEATED = "repeated"  # another sample has this stamp
    DOUBTFUL = "doubtful"  # far from the samples before: kept until others confirm it
    SET_FORWARD = "set forward"  # confirmed: messages were missing, or the clock was set
    SET_BACK = "set back"  # confirmed: the clock was set back, as when a bag begins again


@dataclass
class StampedSamples:
    """Samples by stamp. A stamp far from those before is believed when others follow it.

    Parameters
    ----------
    reach : int
        Distance from the newest stamp, in ns, up to which a sample is taken without question.
    """

    reach: int
    newest: int | None = None
    samples: dict[int, float] = field(default_factory=dict)
    _doubtful: dict[int, float] = field(default_factory=dict)

    def add(self, stamp: int, value: float) -> Stamp:
        """Take a sample with the stamp of its message in ns."""
        if stamp in self.samples:
            return Stamp.REPEATED
        if self.newest is None or abs(stamp - self.newest) <= self.reach:
            self.newest = stamp if self.newest is None else max(stamp, self.newest)
            self.samples[stamp] = value
            self._doubtful = {}
            return Stamp.USED
        if self._doubtful and not 0 < stamp - max(self._doubtful) <= self.reach:
            self._doubtful = {}
        self._doubtful[stamp] = value
        if len(self._doubtful) < CONFIRMED_BY:
            return Stamp.DOUBTFUL
        back = stamp < self.newest
        if back:
            self.samples = {}
        self.samples |= self._doubtful
        self.newest, self._doubtful = stamp, {}
        return Stamp.SET_BACK if back else Stamp.SET_FORWARD

    def forget(self) -> None:
        """Begin again, also with the clock."""
        self.newest, self.samples, self._doubtful = None, {}, {}
