"""Steady windows of a run, and what is left out of it, with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.log_import.mapping.log_map import LeaveOut, WindowSettings
from soilml.log_import.windows.change_points import steady_pieces
from soilml.log_import.windows.mean_errors import mean_error
from soilml.remarks import Remark

#: Quantities whose changes end a window, and the least change that counts, as a share of the
#: quantity's usual size in the run.
_WATCHED = {"rim_speed": 0.01, "speed": 0.015, "slip": 0.01, "torque": 0.03, "load": 0.03,
            "drawbar_pull": 0.04}  # fmt: skip
#: Most values in the search, and shortest stretch over which samples are averaged for it, s.
_MOST_VALUES, _SHORTEST_MEAN = 500, 0.1
_MISSING = 0.2  # Largest share of missing samples in a window
#: Largest change of the slip within a window, and of the torque, as a share of it.
_SLIP_CHANGE, _TORQUE_CHANGE = 0.05, 0.15
_SIGNIFICANT = 4.0  # A change within a window counts where it is this many standard errors
#: Share of the usual speed, or of the usual torque, below which a wheel is at rest.
_AT_REST = 0.1


@dataclass(frozen=True)
class Stretch:
    """A stretch of a run, s after its start; `why` it is left out, None for a steady window."""

    start: float
    stop: float
    why: Remark | None = None


def steady_windows(
    time: Floats,
    quantities: Mapping[str, Floats],
    settings: WindowSettings,
    left_out: tuple[LeaveOut, ...] = (),
    motion: Floats | None = None,
) -> list[Stretch]:
    """Divide a run into steady windows and stretches that are left out, in order of time.

    time: Uniform grid (n,), s.
    quantities: Samples (n,) by name: `rim_speed`, `speed`, `torque`, ...
    settings: How steady and how long windows are.
    left_out: Stretches that the user leaves out of this run.
    motion: What is zero where the wheel rests (n,); None where nothing says it.
    """
    search = _Search(time, quantities, settings, motion)
    parts, found = searched_parts(time, left_out)
    for part in parts:
        rows = np.flatnonzero(search.inside(*part))
        for start, stop in search.pieces(rows) if rows.size > 1 else ():
            found.append(Stretch(start, stop, search.why_not(start, stop)))
    return sorted(found, key=lambda s: s.start)


def searched_parts(
    time: Floats, left_out: tuple[LeaveOut, ...]
) -> tuple[list[tuple[float, float]], list[Stretch]]:
    """The parts of a run (from, until; s) in which rows are searched, and what the map leaves out.

    time: Grid (n,), s.
    """
    first, last = float(time[0]), float(time[-1])
    out = []
    for entry in left_out:
        why = Remark("left-out-by-map", entry.why, severity="note")
        out.append(Stretch(max(entry.start, first), min(entry.stop, last), why))
    out = sorted((s for s in out if s.start < s.stop), key=lambda s: s.start)
    starts = [first, *np.maximum.accumulate([s.stop for s in out])] if out else [first]
    stops = [*(s.start for s in out), last]
    parts = [(float(a), b) for a, b in zip(starts, stops, strict=True) if a < b]
    return parts, out


@dataclass(frozen=True)
class _Search:
    """A run in which steady windows are searched: its grid (n,) and its samples by name (n,)."""

    time: Floats
    quantities: Mapping[str, Floats]
    settings: WindowSettings
    motion: Floats | None

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])

    def known(self, name: str, rows: NDArray[np.bool_] | slice = slice(None)) -> Floats | None:
        """A quantity in some rows; None where it has no numbers there."""
        values = self.quantities.get(name)
        return None if values is None or not np.isfinite(values[rows]).any() else values[rows]

    def pieces(self, rows: NDArray[np.intp]) -> list[tuple[float, float]]:
        """Pieces of a part of the run between change points, s, without the settling at its ends.

        At most a fifth of a piece is settling on each side.
        """
        time, step, settings = self.time[rows], self.step, self.settings
        width = max(1, round(max(_SHORTEST_MEAN, step * time.size / _MOST_VALUES) / step))
        count = max(1, time.size // width)
        columns, least = [], []
        both = {"rim_speed", "speed"} <= self.quantities.keys()
        for name, change in _WATCHED.items():
            values = self.quantities.get(name, np.zeros(0))
            # slip follows from two speeds, and is noise where the wheel rests
            if values.size and np.isfinite(values).mean() > 0.1 and not (both and name == "slip"):
                blocks = values[rows][: width * count].reshape(count, width)
                valid = np.isfinite(blocks)
                sums, sizes = np.where(valid, blocks, 0.0).sum(axis=1), valid.sum(axis=1)
                filled = np.flatnonzero(sizes)
                means = np.interp(np.arange(count), filled, sums[filled] / sizes[filled])
                if (size := float(np.nanpercentile(np.abs(means), 90))) > 0.0:
                    columns.append(means)
                    least.append(change * size)
        if not columns:
            return [(float(time[0]), float(time[-1]))]
        shortest = max(1, round(0.25 * settings.shortest / (width * step)))
        parts = steady_pieces(
            np.stack(columns, axis=1), np.asarray(least), settings.sensitivity, shortest
        )
        edges = float(time[0]) + step * width * np.asarray([a for a, _ in parts] + [parts[-1][1]])
        edges[-1] = time[-1]
        found = []
        for start, stop in pairwise(map(float, edges)):
            margin = min(settings.settle, 0.2 * (stop - start))
            first = start if start <= time[0] + step else start + margin
            found.append((first, stop if stop >= time[-1] - step else stop - margin))
        return found

    def inside(self, start: float, stop: float) -> NDArray[np.bool_]:
        """Samples (n,) of a stretch."""
        return np.asarray((self.time >= start) & (self.time <= stop))

    def why_not(self, start: float, stop: float) -> Remark | None:
        """Why a stretch is no steady window; None where it is one."""
        rows, shortest = self.inside(start, stop), self.settings.shortest
        if self.rests(rows):
            return Remark("at-rest", "the wheel is at rest", severity="note")
        if stop - start < shortest:
            text = f"nothing stays the same for {shortest:g} s"
            return Remark("too-short", text, severity="note")
        if not rows.any():
            return Remark("no-samples", "there are no samples")
        for name in (name for name in ("slip", "load") if name in self.quantities):
            missing = np.mean(~np.isfinite(self.quantities[name][rows]))
            if missing > _MISSING:
                return Remark("missing-samples", f"{missing:.0%} of the {name} is missing", (name,))
        return self.drift(rows)

    def drift(self, rows: NDArray[np.bool_]) -> Remark | None:
        """Which quantity changes within a window by more than it may; None where none does."""
        for name in ("slip", "torque"):
            if (values := self.known(name, rows)) is None:
                continue
            third = len(values) // 3
            first, last = (mean_error(v, self.step) for v in (values[:third], values[-third:]))
            change, error = abs(last[0] - first[0]), float(np.hypot(first[1], last[1]))
            limit = _SLIP_CHANGE
            if name == "torque":
                usual = float(np.nanmean(np.abs(values)))
                limit = _TORQUE_CHANGE * usual
            if change > limit and not change < _SIGNIFICANT * error:
                text = f"it is not steady: {name} changes by {change:.2g} in it"
                return Remark("not-steady", text, (name,), "note")
        return None

    def rests(self, rows: NDArray[np.bool_]) -> bool:
        """Whether the wheel is at rest in a window; not where nothing says it."""
        motion = self.motion
        if motion is None or not np.isfinite(motion[rows]).any():
            return False
        usual = float(np.nanpercentile(np.abs(motion), 90))
        return float(np.nanmedian(np.abs(motion[rows]))) < _AT_REST * usual
