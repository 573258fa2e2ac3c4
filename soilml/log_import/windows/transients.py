"""Transients at the ends of a window."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from soilml.log_import.recording import Floats

#: Quantities whose transients count, number of means that a window is divided into, and the
#: largest share of it that is cut off at the beginning and at the end.
_WATCHED, _MEANS = ("slip", "torque"), 50
_MOST_BEFORE, _MOST_AFTER = 0.4, 0.15
#: The rule has to lower its criterion to this share: noise alone lowers it by a few per cent.
_GAIN = 0.85


def without_transients(
    time: Floats, quantities: Mapping[str, Floats], start: float, stop: float
) -> tuple[float, float]:
    """Ends of the window (s) without the settling after its beginning and a change at its end.

    The part that is kept has the smallest sum of squared deviations over the square of its length:
    the marginal standard error rule of White, "An effective truncation heuristic for bias reduction
    in simulation output", Simulation 69 (1997), here for the sum of slip and torque in units of
    their scatter in the middle of the window.
    """
    rows = np.flatnonzero((time >= start) & (time <= stop))
    count = min(_MEANS, rows.size // 4)
    if count < 10:
        return start, stop
    edges = np.linspace(0, rows.size, count + 1).astype(int)
    columns = []
    for name in _WATCHED:
        values = quantities.get(name, np.zeros(0))
        if values.size != time.size:
            continue
        means = np.asarray(
            [
                np.mean(part) if np.isfinite(part).all() else np.nan
                for part in np.split(values[rows], edges[1:-1])
            ]
        )
        middle = means[count // 4 : -count // 4]
        if np.isfinite(means).all() and np.ptp(middle) > 0.0:
            columns.append((means - middle.mean()) / middle.std())
    if not columns:
        return start, stop
    series = np.stack(columns, axis=1)
    first = _cheapest(series, int(_MOST_BEFORE * count))
    last = count - _cheapest(series[first:][::-1], int(_MOST_AFTER * count))
    own = time[rows]
    return (
        start if first == 0 else float(own[edges[first]]),
        stop if last == count else float(own[edges[last] - 1]),
    )


def _cheapest(series: Floats, most: int) -> int:
    """How many of the first values to leave out, at most `most`."""
    costs = [
        float(np.sum((kept - kept.mean(axis=0)) ** 2)) / len(kept) ** 2
        for kept in (series[i:] for i in range(most + 1))
    ]
    best = int(np.argmin(costs))
    return best if costs[best] < _GAIN * costs[0] else 0
