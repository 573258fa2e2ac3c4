"""Samples of several clocks on one uniform grid, and derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats

MOST_POINTS, SHORTEST_STEP = 20_000, 0.002  # Most points of a grid, and its shortest step in s
#: A gap is bridged up to this many sampling intervals, long intervals (the 90th percentile), or
#: seconds.
_BRIDGED_SAMPLES, _BRIDGED_LONG, _BRIDGED_SECONDS = 3.5, 2.0, 0.05


def sampling_interval(times: Floats, values: Floats) -> float:
    """Median interval of the samples that are numbers, s; infinite for fewer than two."""
    own = times[np.isfinite(values)]
    return float(np.median(np.diff(own))) if own.size > 1 else float("inf")


def on_grid(grid: Floats, times: Floats, values: Floats, continuous: bool = False) -> Floats:
    """Samples on a grid (n,), NaN in gaps.

    A channel that is faster than the grid is averaged around each point, a slower one is
    interpolated. With `continuous`, always interpolated: a place at one time, not a mean of places.
    """
    valid = np.isfinite(values)
    own_times, own = times[valid], values[valid]
    if own.size < 2 or grid.size < 2:
        return np.full(grid.size, np.nan)
    step, interval = grid[1] - grid[0], float(np.median(np.diff(own_times)))
    result = np.interp(grid, own_times, own)
    if interval < 0.6 * step and not continuous:
        edges = np.concatenate([grid - step / 2, [grid[-1] + step / 2]])
        place = np.searchsorted(edges, own_times, side="right") - 1
        inside = (place >= 0) & (place < grid.size)
        count = np.bincount(place[inside], minlength=grid.size)
        total = np.bincount(place[inside], own[inside], minlength=grid.size)
        result = np.where(count > 0, total / np.maximum(count, 1), result)
    result[_in_gap(grid, own_times, interval)] = np.nan
    return result


def _in_gap(grid: Floats, times: Floats, interval: float) -> NDArray[np.bool_]:
    """Points of a grid that lie in a gap between samples, or outside of them, (n,)."""
    # intervals of a channel that is sampled irregularly vary: long ones are no gaps
    usual = _BRIDGED_LONG * float(np.percentile(np.diff(times), 90))
    bridged = max(_BRIDGED_SAMPLES * interval, usual, _BRIDGED_SECONDS)
    after = np.clip(np.searchsorted(times, grid), 1, times.size - 1)
    in_gap = times[after] - times[after - 1] > bridged
    on_sample = np.minimum(np.abs(grid - times[after]), np.abs(grid - times[after - 1]))
    outside = (grid < times[0] - interval) | (grid > times[-1] + interval)
    return np.asarray((in_gap & (on_sample > 0.5 * interval)) | outside)


def unwrapped(values: Floats, period: float) -> Floats:
    """An angle or a counter (n,) that starts again after `period`, without its jumps."""
    result = values.copy()
    known = np.flatnonzero(np.isfinite(values))
    result[known] = np.unwrap(values[known], period=period)
    return result


def derivative(grid: Floats, values: Floats, span: float) -> Floats:
    """Slope of a straight line through the values within half a `span` (s) of each point, (n,).

    Points with fewer than half of the values are NaN. At the ends the stretch is shorter.
    """
    n = grid.size
    if n < 3:
        return np.full(n, np.nan)
    step = grid[1] - grid[0]
    half = max(1, min(round(span / step / 2), (n - 1) // 2))
    valid = np.isfinite(values)
    weight = valid.astype(np.float64)
    filled = np.where(valid, values - (values[valid].mean() if valid.any() else 0.0), 0.0)
    time = step * (np.arange(n) - n / 2)
    places = np.arange(n)
    start, stop = np.maximum(places - half, 0), np.minimum(places + half + 1, n)
    parts = np.stack([weight, weight * time, weight * time**2, filled, filled * time])
    totals = np.pad(np.cumsum(parts, axis=1), ((0, 0), (1, 0)))
    count, t, tt, y, ty = totals[:, stop] - totals[:, start]
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = tt - t * t / count
        slope = (ty - t * y / count) / spread
    return np.where((count >= half + 1) & (spread > 0.0), slope, np.nan)
