"""How the samples of a column behave: what tells a clock, an encoder, a place and a force apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats

#: Range of an angle or counter that starts again, by unit.
_PERIODS = (360.0, 2.0 * np.pi, 65536.0, 4096.0, 1024.0, 8192.0, 16384.0, 32768.0, 4294967296.0)
#: Days of a spreadsheet of the years 1968 to 2119, and their largest step: 10 s.
_DAYS = (25_000.0, 80_000.0, 1.2e-4)


@dataclass(frozen=True)
class Behaviour:
    """Numbers that describe a column."""

    count: int  # Samples that are numbers
    low: float = float("nan")  # 1st and 99th percentile, and median
    high: float = float("nan")
    middle: float = float("nan")
    constant: bool = True  # Whether all samples are equal
    wraps_at: float = 0.0  # Range of an angle or a counter that starts again; 0 where it does not
    # Net change, a share of the sum of all changes: 1 for a monotone column, 0 for a single step
    travel: float = 0.0

    @property
    def size(self) -> float:
        """The larger of the ends, without sign."""
        return max(abs(self.low), abs(self.high))

    @property
    def span(self) -> float:
        """From the lower to the upper end."""
        return self.high - self.low


def behaviour(values: Floats) -> Behaviour:
    """Describe a column (n,)."""
    own = values[np.isfinite(values)]
    if own.size < 2:
        return Behaviour(own.size)
    low, middle, high = (float(v) for v in np.percentile(own, [1, 50, 99]))
    places = own[:: max(1, own.size // 60)]  # noise from sample to sample is no way
    changes = np.abs(np.diff(places))
    total = float(changes.sum())
    is_step = total > 0.0 and float(changes.max()) > 0.5 * total
    travel = abs(float(places[-1] - places[0])) / total if total and not is_step else 0.0
    return Behaviour(own.size, low, high, middle, float(np.ptp(own)) == 0.0, _wrap(own), travel)


def _wrap(own: Floats) -> float:
    """The range after which a column starts again: few jumps back of nearly that size."""
    span, steps = float(np.ptp(own)), np.diff(own)
    jumps = np.flatnonzero(np.abs(steps) > 0.8 * span)
    others = np.delete(steps, jumps)
    if not 0 < jumps.size < own.size / 4 or span == 0.0 or others.size == 0:
        return 0.0
    # of a force that comes and goes, nothing moves between the jumps
    if np.percentile(np.abs(others), 99) > 0.25 * span or abs(others.sum()) < 0.3 * span:
        return 0.0
    return next((float(p) for p in _PERIODS if 0.93 * p < span <= 1.02 * p), 0.0)


def clock_score(values: Floats, named: bool) -> float:
    """How much a column looks like a clock, 0 to 1: it rises, by even steps unless it is `named`.

    A clock that is named may jitter, and show one time several times.
    """
    steps = np.diff(values[np.isfinite(values)])
    moved = steps[steps != 0.0] if named else steps
    if moved.size < 8 or np.mean(moved > 0.0) < 0.97:
        return 0.0
    middle = float(np.median(steps))
    return 1.0 if named else float(np.mean(np.abs(steps - middle) < 0.5 * middle))


def time_unit(values: Floats) -> str:
    """The likely unit of a clock: s, ms, us, ns or d, by its size and by its steps.

    Loggers sample between once in two seconds and 20000 times a second; clocks since 1970 have ten
    digits in s, thirteen in ms. Spreadsheets count days since 1900.
    """
    own = values[np.isfinite(values)]
    if own.size < 2:
        return "s"
    first, steps, span = float(abs(own[0])), np.diff(own), float(np.ptp(own))
    for unit, least in (("ns", 5e17), ("us", 5e14), ("ms", 5e11), ("s", 5e8)):
        if first > least:
            return unit
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    if _DAYS[0] < first < _DAYS[1] and step < _DAYS[2]:
        return "d"
    if step > 5e5:
        return "ns"
    if step >= 500.0 and span > 3.6e6:
        return "us"
    return "ms" if step >= 1.0 and span > 300.0 and own.size > 50 else "s"
