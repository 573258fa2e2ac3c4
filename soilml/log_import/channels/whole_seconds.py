"""Clocks that show whole seconds, while several lines were written in each of them."""

from __future__ import annotations

import numpy as np

from soilml.log_import.recording import Floats

#: Fewest different seconds, and share of the seconds that must have several lines.
_FEWEST, _SEVERAL = 5, 0.8


def spread_over_seconds(clock: Floats) -> Floats:
    """Time (n,) in s with the lines of each second evenly over it; `clock` itself where it has
    fractions, or one line a second.

    The first second may have begun before the log, and the last one ends after it: these have the
    step of the others.
    """
    known = np.flatnonzero(np.isfinite(clock))
    own = clock[known]
    if own.size == 0 or np.any(own != np.round(own)) or np.any(np.diff(own) < 0.0):
        return clock
    seconds, first, count = np.unique(own, return_index=True, return_counts=True)
    if seconds.size < _FEWEST or np.mean(count[1:-1] > 1) < _SEVERAL:
        return clock
    usual = float(np.median(count[1:-1]))
    lines = count.astype(np.float64)
    lines[[0, -1]] = np.maximum(lines[[0, -1]], usual)
    late = np.zeros(seconds.size)
    late[0] = lines[0] - count[0]
    place = np.arange(own.size) - np.repeat(first, count) + np.repeat(late, count)
    spread = clock.copy()
    spread[known] = own + place / np.repeat(lines, count)
    return spread
