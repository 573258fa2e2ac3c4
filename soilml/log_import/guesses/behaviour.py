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
    """Numbers that describe a column.

    count: Samples that are numbers.
    low, high, middle: 1st and 99th percentile, and median.
    rising: Share of the steps that are above zero, among those that are not zero.
    constant: Whether all samples are equal.
    wraps_at: Range of an angle or a counter that starts again; 0 where it does not.
    travel: Net change, a share of the sum of all changes: 1 for a monotone column, 0 for a single
        step.
    """

    count: int
    low: float = float("nan")
    high: float = float("nan")
    middle: float = float("nan")
    rising: float = 0.0
    constant: bool = True
    wraps_at: float = 0.0
    travel: float = 0.0

    @property
    def size(self) -> float:
        """The larger of the ends, without sign."""
        return max(abs(self.low), abs(self.high))


def behaviour(values: Floats) -> Behaviour:
    """Describe a column (n,)."""
    own = values[np.isfinite(values)]
    if own.size < 2:
        return Behaviour(count=own.size)
    steps = np.diff(own)
    low, middle, high = (float(v) for v in np.percentile(own, [1, 50, 99]))
    moved = steps[steps != 0.0]
    # noise from sample to sample is no way
    places = own[:: max(1, own.size // 60)]
    changes = np.abs(np.diff(places))
    total = float(changes.sum())
    is_step = total > 0.0 and float(changes.max()) > 0.5 * total
    return Behaviour(
        count=own.size,
        low=low,
        high=high,
        middle=middle,
        rising=float(np.mean(moved > 0.0)) if moved.size else 0.0,
        constant=float(np.ptp(own)) == 0.0,
        wraps_at=_wrap(own, steps),
        travel=abs(float(places[-1] - places[0])) / total if total and not is_step else 0.0,
    )


def _wrap(own: Floats, steps: Floats) -> float:
    """The range after which a column starts again: few jumps back of nearly that size."""
    span = float(np.ptp(own))
    jumps = np.flatnonzero(np.abs(steps) > 0.8 * span)
    if not 0 < jumps.size < own.size / 4 or span == 0.0:
        return 0.0
    others = np.abs(np.delete(steps, jumps))
    if others.size == 0 or float(np.percentile(others, 99)) > 0.25 * span:
        return 0.0
    if abs(float(np.delete(steps, jumps).sum())) < 0.3 * span:
        return 0.0  # a force that comes and goes: nothing moves between the jumps
    for period in _PERIODS:
        if 0.93 * period < span <= 1.02 * period:
            return float(period)
    return 0.0


def rises(values: Floats) -> float:
    """1 for a column that rises as a clock does, which may show one time several times; else 0."""
    own = values[np.isfinite(values)]
    steps = np.diff(own)
    steps = steps[steps != 0.0]
    return float(steps.size >= 8 and np.mean(steps > 0.0) >= 0.97)


def looks_like_time(values: Floats) -> float:
    """How much a column looks like a clock, 0 to 1: it rises by even steps."""
    own = values[np.isfinite(values)]
    steps = np.diff(own)
    if steps.size < 8 or np.mean(steps > 0.0) < 0.97:
        return 0.0
    middle = float(np.median(steps))
    return float(np.mean(np.abs(steps - middle) < 0.5 * middle))


def time_unit(values: Floats) -> str:
    """The likely unit of a clock: s, ms, us, ns or d, by its size and by its steps.

    Loggers sample between once in two seconds and 20000 times a second; clocks since 1970 have ten
    digits in s, thirteen in ms. Spreadsheets count days since 1900.
    """
    own = values[np.isfinite(values)]
    if own.size < 2:
        return "s"
    first = float(abs(own[0]))
    for unit, least in (("ns", 5e17), ("us", 5e14), ("ms", 5e11), ("s", 5e8)):
        if first > least:
            return unit
    steps = np.diff(own)
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    if _DAYS[0] < first < _DAYS[1] and step < _DAYS[2]:
        return "d"
    if step > 5e5:
        return "ns"
    if step >= 500.0 and float(np.ptp(own)) / 1e3 > 3600.0:
        return "us"
    return "ms" if step >= 1.0 and float(np.ptp(own)) > 300.0 and own.size > 50 else "s"
