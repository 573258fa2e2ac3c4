"""Steady windows of a run, and what is left out of it, with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.log_import.mapping.log_map import LeaveOut, WindowSettings
from soilml.log_import.windows.change_points import steady_pieces, without_transients
from soilml.log_import.windows.mean_errors import mean_error
from soilml.remarks import Remark

#: Quantities whose changes end a window, and the least change that counts, as a share of the
#: quantity's usual size in the run.
_WATCHED = {"rim_speed": 0.01, "speed": 0.015, "slip": 0.01, "torque": 0.03, "load": 0.03,
            "drawbar_pull": 0.04}  # fmt: skip
#: Most values in the search, and shortest stretch over which samples are averaged for it, s.
_MOST_VALUES, _SHORTEST_MEAN = 500, 0.1
_MISSING = 0.2  # Largest share of missing samples in a window
_SIGNIFICANT = 4.0  # A change within a window counts where it is this many standard errors
_FINER = 3.0  # How much more sensitive the second search is, in a piece that drifts
#: Share of the usual speed of the rim, or of the usual torque, below which a wheel is at rest.
_AT_REST = 0.1
#: Beginning of a log in which the wheel may rest, s, and a slip that is another than there.
_FIRST, _OTHER_SLIP = 0.4, 0.03


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
) -> list[Stretch]:
    """Divide a run into steady windows and stretches that are left out, in order of time.

    time: Uniform grid (n,), s.
    quantities: Samples (n,) by name: `rim_speed`, `speed`, `torque`, ...
    settings: How steady and how long windows are.
    left_out: Stretches that the user leaves out of this run.
    """
    search = _Search(time, quantities, settings)
    found: list[Stretch] = []
    for start, stop in search.pieces(np.arange(time.size), settings.sensitivity):
        for p, q in _without(start, stop, settings, left_out):
            found += search.judged(p, q)
    for entry in left_out:
        ends = max(entry.start, float(time[0])), min(entry.stop, float(time[-1]))
        found.append(Stretch(*ends, Remark("left-out-by-map", entry.why, severity="note")))
    return _joined(sorted(found, key=lambda s: s.start), settings)


def _joined(stretches: list[Stretch], settings: WindowSettings) -> list[Stretch]:
    """Stretches of which those that are too short, and follow each other, are one."""
    found: list[Stretch] = []
    short: list[Stretch] = []
    for stretch in [*stretches, None]:
        if stretch is not None and stretch.why is not None and stretch.why.code == "too-short":
            short.append(stretch)
            continue
        if len(short) < 3:
            found += short
        else:
            text = (
                f"nothing stays the same for {settings.shortest:g} s, as if someone had touched it"
            )
            why = Remark("nothing-steady", text)
            found.append(Stretch(short[0].start, short[-1].stop, why))
        short = []
        found += [stretch] if stretch is not None else []
    return found


def _without(
    start: float, stop: float, settings: WindowSettings, left_out: tuple[LeaveOut, ...]
) -> list[tuple[float, float]]:
    """A piece without what the user leaves out; what is outside of `within` is kept apart."""
    parts = [(start, stop)]
    cuts = [(e.start, e.stop) for e in left_out]
    low, high = settings.within
    for edge in (low, high):
        parts = [
            piece
            for a, b in parts
            for piece in ([(a, edge), (edge, b)] if a < edge < b else [(a, b)])
        ]
    for a, b in cuts:
        parts = [
            piece
            for p, q in parts
            for piece in ((p, min(q, a)), (max(p, b), q))
            if piece[0] < piece[1]
        ]
    return parts


def _block_means(values: Floats, width: int, count: int) -> Floats:
    """Means of `count` blocks of `width` samples, (count,), gaps interpolated."""
    blocks = values[: width * count].reshape(count, width)
    valid = np.isfinite(blocks)
    sums = np.where(valid, blocks, 0.0).sum(axis=1)
    means = np.where(valid.any(axis=1), sums / np.maximum(valid.sum(axis=1), 1), np.nan)
    known = np.flatnonzero(np.isfinite(means))
    return np.interp(np.arange(count), known, means[known])


@dataclass(frozen=True)
class _Search:
    """A run in which steady windows are searched: its grid (n,) and its samples by name (n,)."""

    time: Floats
    quantities: Mapping[str, Floats]
    settings: WindowSettings

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])

    def watched(self) -> dict[str, Floats]:
        """The quantities whose changes end a window."""
        found = {
            name: self.quantities[name]
            for name in _WATCHED
            if name in self.quantities and np.isfinite(self.quantities[name]).mean() > 0.1
        }
        if "rim_speed" in found and "speed" in found:
            found.pop("slip", None)  # it follows from them, and is noise where the wheel rests
        return found

    def pieces(self, rows: NDArray[np.intp], sensitivity: float) -> list[tuple[float, float]]:
        """Pieces of a part of the run between change points, s, without the settling at its ends.

        At most a fifth of a piece is settling on each side.
        """
        time, step, settings = self.time[rows], self.step, self.settings
        width = max(1, round(max(_SHORTEST_MEAN, step * time.size / _MOST_VALUES) / step))
        count = max(1, time.size // width)
        columns, least = [], []
        for name, values in self.watched().items():
            means = _block_means(values[rows], width, count)
            size = float(np.nanpercentile(np.abs(means), 90))
            if size > 0.0:
                columns.append(means)
                least.append(_WATCHED[name] * size)
        if not columns:
            return [(float(time[0]), float(time[-1]))]
        shortest = max(1, round(0.25 * settings.shortest / (width * step)))
        parts = steady_pieces(np.stack(columns, axis=1), np.asarray(least), sensitivity, shortest)
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

    def judged(self, start: float, stop: float, finer: bool = True) -> list[Stretch]:
        """A piece as one stretch; where it drifts, as what a finer search makes of it."""
        a, b = without_transients(self.time, self.quantities, start, stop)
        why = self.why_not(a, b)
        if why is None or why.code != "not-steady":
            return [Stretch(a, b, why)]
        if not finer:
            return [self.shortened(Stretch(a, b, why))]
        rows = np.flatnonzero(self.inside(start, stop))
        parts = self.pieces(rows, _FINER * self.settings.sensitivity)
        return [stretch for p, q in parts for stretch in self.judged(p, q, finer=False)]

    def why_not(self, start: float, stop: float) -> Remark | None:
        """Why a stretch is no steady window; a part of one that is `not-steady` may be one."""
        rows, shortest = self.inside(start, stop), self.settings.shortest
        low, high = self.settings.within
        if stop <= low or start >= high:
            return Remark("outside", "outside of [windows] within", severity="note")
        if rests := self.why_at_rest(rows):
            return rests
        if stop - start < shortest:
            text = f"{stop - start:.2g} s are too short (less than {shortest:g} s)"
            return Remark("too-short", text, severity="note")
        if not rows.any():
            return Remark("no-samples", "there are no samples")
        for name in ("slip", "load"):
            if name in self.quantities:
                missing = np.mean(~np.isfinite(self.quantities[name][rows]))
                if missing > _MISSING:
                    text = f"{missing:.0%} of the {name} is missing"
                    return Remark("missing-samples", text, (name,))
        return self.drift(rows)

    def drift(self, rows: NDArray[np.bool_]) -> Remark | None:
        """Which quantity changes within a window by more than it may; None where none does."""
        for name in ("slip", "torque"):
            if name not in self.quantities or not np.isfinite(self.quantities[name][rows]).any():
                continue
            values = self.quantities[name][rows]
            third = len(values) // 3
            first, last = (mean_error(v, self.step) for v in (values[:third], values[-third:]))
            change, error = abs(last[0] - first[0]), float(np.hypot(first[1], last[1]))
            limit = self.settings.largest_slip_change
            if name == "torque":
                usual = float(np.nanmean(np.abs(values)))
                limit = self.settings.largest_torque_change * usual
            if change > limit and not change < _SIGNIFICANT * error:
                text = f"it is not steady: {name} changes by {change:.2g} in it"
                return Remark("not-steady", text, (name,), "note")
        return None

    def shortened(self, stretch: Stretch) -> Stretch:
        """The longest end or beginning of a drifting stretch that is steady, else all of it."""
        start, stop = stretch.start, stretch.stop
        length = stop - start
        for share in (0.8, 0.65, 0.5, 0.35):
            for a, b in ((stop - share * length, stop), (start, start + share * length)):
                if b - a >= self.settings.shortest and not self.drift(self.inside(a, b)):
                    return Stretch(a, b)
        return stretch

    def why_at_rest(self, rows: NDArray[np.bool_]) -> Remark | None:
        """By what the wheel is at rest in a window; None where it turns, or nothing says it."""
        rim = self.quantities.get("rim_speed", self.quantities.get("speed"))
        if rim is not None and np.isfinite(rim[rows]).any():
            usual = float(np.nanpercentile(np.abs(rim), 90))
            rests = float(np.nanmedian(np.abs(rim[rows]))) < _AT_REST * usual
            return Remark("at-rest", "the wheel is at rest", severity="note") if rests else None
        torque = self.quantities.get("torque")
        if torque is None or not np.isfinite(torque[rows]).any():
            return None
        near_zero = _AT_REST * float(np.nanpercentile(np.abs(torque), 90))
        above = float(np.nanmedian(np.abs(torque[rows]))) >= near_zero
        if above or self.slips(rows, near_zero):
            return None
        text = "the torque is near zero: the wheel is probably at rest"
        return Remark("torque-near-zero", text, ("torque",))

    def slips(self, rows: NDArray[np.bool_], near_zero: float) -> bool:
        """Whether a window without torque has a slip of its own: where a wheel begins to brake.

        It is one that varies little and is not that of the rest with which the log begins.
        """
        slip, torque = self.quantities.get("slip"), self.quantities["torque"]
        first = max(3, round(_FIRST / self.step))
        if slip is None or not (np.isfinite(slip[:first]).any() and np.isfinite(slip[rows]).any()):
            return False
        middle = float(np.nanmedian(slip[rows]))
        steady = float(np.nanstd(slip[rows])) < 0.5 * abs(middle)
        rests = np.isfinite(torque[:first]).any() and abs(np.nanmedian(torque[:first])) < near_zero
        other = abs(middle - float(np.nanmedian(slip[:first]))) > _OTHER_SLIP
        return bool(steady and rests and other)
