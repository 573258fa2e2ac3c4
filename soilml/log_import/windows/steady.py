"""Steady windows of a run, and what is left out of it, with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilml.log_import.mapping.log_map import LeaveOut, WindowSettings
from soilml.log_import.recording import Floats
from soilml.log_import.windows.change_points import steady_pieces, without_transients
from soilml.log_import.windows.mean_errors import mean_error
from soilml.remarks import Remark

#: Quantities whose changes end a window, and the least change that counts, as a share of the
#: quantity's usual size in the run.
_WATCHED = {"rim_speed": 0.01, "speed": 0.015, "slip": 0.01, "torque": 0.03, "load": 0.03,
            "drawbar_pull": 0.04}  # fmt: skip
#: Most values in the search, and shortest stretch over which samples are averaged for it, s.
_MOST_VALUES, _SHORTEST_MEAN = 500, 0.1
#: Largest share of missing samples in a window.
_MISSING = 0.2
#: A change within a window counts where it is this many standard errors.
_SIGNIFICANT = 4.0
#: How much more sensitive the second search is, in a piece that drifts.
_FINER = 3.0
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

    Parameters
    ----------
    time
        Uniform grid (n,), s.
    quantities
        Samples (n,) by name: `rim_speed`, `speed`, `torque`, ...
    settings
        How steady and how long windows are.
    left_out
        Stretches that the user leaves out of this run.
    """
    step = float(time[1] - time[0])
    watched = {
        name: quantities[name]
        for name in _WATCHED
        if name in quantities and np.isfinite(quantities[name]).mean() > 0.1
    }
    if "rim_speed" in watched and "speed" in watched:
        watched.pop("slip", None)  # it follows from them, and is noise where the wheel rests
    found: list[Stretch] = []
    for start, stop in _pieces(time, step, watched, settings):
        for p, q in _without(*_trim(time, start, stop, step, settings), settings, left_out):
            found += _judged(time, step, quantities, watched, p, q, settings)
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


def _judged(
    time: Floats,
    step: float,
    quantities: Mapping[str, Floats],
    watched: Mapping[str, Floats],
    start: float,
    stop: float,
    settings: WindowSettings,
    finer: bool = True,
) -> list[Stretch]:
    """A piece as one stretch; where it drifts, as what a finer search makes of it."""
    a, b = without_transients(time, quantities, start, stop)
    why = _why_not(time, step, quantities, a, b, settings)
    if why is None or why.code != "not-steady":
        return [Stretch(a, b, why)]
    if not finer:
        return [_shortened(time, step, quantities, Stretch(a, b, why), settings)]
    rows = np.flatnonzero(_inside(time, start, stop))
    part = {name: values[rows] for name, values in watched.items()}
    closer = replace(settings, sensitivity=_FINER * settings.sensitivity)
    return [
        stretch
        for p, q in _pieces(time[rows], step, part, closer)
        for stretch in _judged(
            time,
            step,
            quantities,
            watched,
            *_trim(time[rows], p, q, step, settings),
            settings,
            finer=False,
        )
    ]


def _pieces(
    time: Floats, step: float, watched: Mapping[str, Floats], settings: WindowSettings
) -> list[tuple[float, float]]:
    """Pieces of a run between change points, s."""
    if not watched:
        return [(float(time[0]), float(time[-1]))]
    width = max(1, round(max(_SHORTEST_MEAN, step * time.size / _MOST_VALUES) / step))
    count = max(1, time.size // width)
    columns, least = [], []
    for name, values in watched.items():
        means = _block_means(values, width, count)
        size = float(np.nanpercentile(np.abs(means), 90))
        if size > 0.0:
            columns.append(means)
            least.append(_WATCHED[name] * size)
    if not columns:
        return [(float(time[0]), float(time[-1]))]
    shortest = max(1, round(0.25 * settings.shortest / (width * step)))
    pieces = steady_pieces(
        np.stack(columns, axis=1), np.asarray(least), settings.sensitivity, shortest
    )
    edges = float(time[0]) + step * width * np.asarray([a for a, _ in pieces] + [pieces[-1][1]])
    edges[-1] = time[-1]
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def _block_means(values: Floats, width: int, count: int) -> Floats:
    """Means of `count` blocks of `width` samples, (count,), gaps interpolated."""
    blocks = values[: width * count].reshape(count, width)
    valid = np.isfinite(blocks)
    sums = np.where(valid, blocks, 0.0).sum(axis=1)
    means = np.where(valid.any(axis=1), sums / np.maximum(valid.sum(axis=1), 1), np.nan)
    known = np.flatnonzero(np.isfinite(means))
    return np.interp(np.arange(count), known, means[known])


def _trim(
    time: Floats, start: float, stop: float, step: float, settings: WindowSettings
) -> tuple[float, float]:
    """A piece without the settling at its ends, at most a fifth of it on each side."""
    margin = min(settings.settle, 0.2 * (stop - start))
    return (
        start if start <= time[0] + step else start + margin,
        stop if stop >= time[-1] - step else stop - margin,
    )


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


def _inside(time: Floats, start: float, stop: float) -> NDArray[np.bool_]:
    return np.asarray((time >= start) & (time <= stop))


def _why_not(
    time: Floats,
    step: float,
    quantities: Mapping[str, Floats],
    start: float,
    stop: float,
    settings: WindowSettings,
) -> Remark | None:
    """Why a stretch is no steady window; a part of one that is `not-steady` may be one."""
    rows = _inside(time, start, stop)
    low, high = settings.within
    if stop <= low or start >= high:
        return Remark("outside", "outside of [windows] within", severity="note")
    if rests := _why_at_rest(step, quantities, rows):
        return rests
    if stop - start < settings.shortest:
        text = f"{stop - start:.2g} s are too short (less than {settings.shortest:g} s)"
        return Remark("too-short", text, severity="note")
    if not rows.any():
        return Remark("no-samples", "there are no samples")
    for name in ("slip", "load"):
        if name in quantities and np.mean(~np.isfinite(quantities[name][rows])) > _MISSING:
            missing = np.mean(~np.isfinite(quantities[name][rows]))
            return Remark("missing-samples", f"{missing:.0%} of the {name} is missing", (name,))
    return _drift(step, quantities, rows, settings)


def _drift(
    step: float,
    quantities: Mapping[str, Floats],
    rows: NDArray[np.bool_],
    settings: WindowSettings,
) -> Remark | None:
    """Which quantity changes within a window by more than it may; None where none does."""
    for name, relative in (("slip", False), ("torque", True)):
        if name not in quantities or not np.isfinite(quantities[name][rows]).any():
            continue
        values = quantities[name][rows]
        third = len(values) // 3
        first, last = mean_error(values[:third], step), mean_error(values[-third:], step)
        change, error = abs(last[0] - first[0]), float(np.hypot(first[1], last[1]))
        limit = settings.largest_slip_change
        if relative:
            limit = settings.largest_torque_change * float(np.nanmean(np.abs(values)))
        if change > limit and not change < _SIGNIFICANT * error:
            text = f"it is not steady: {name} changes by {change:.2g} in it"
            return Remark("not-steady", text, (name,), "note")
    return None


def _shortened(
    time: Floats,
    step: float,
    quantities: Mapping[str, Floats],
    stretch: Stretch,
    settings: WindowSettings,
) -> Stretch:
    """The longest end or beginning of a drifting stretch that is steady, else all of it."""
    start, stop = stretch.start, stretch.stop
    length = stop - start
    for share in (0.8, 0.65, 0.5, 0.35):
        for a, b in ((stop - share * length, stop), (start, start + share * length)):
            long_enough = b - a >= settings.shortest
            if long_enough and not _drift(step, quantities, _inside(time, a, b), settings):
                return Stretch(a, b)
    return stretch


def _why_at_rest(
    step: float, quantities: Mapping[str, Floats], rows: NDArray[np.bool_]
) -> Remark | None:
    """By what the wheel is at rest in a window; None where it turns, or nothing says it.

    `quantities` are samples (n,) of a run, `rows` (n,) those of the window.
    """
    rim = quantities.get("rim_speed", quantities.get("speed"))
    if rim is not None and np.isfinite(rim[rows]).any():
        usual = float(np.nanpercentile(np.abs(rim), 90))
        rests = float(np.nanmedian(np.abs(rim[rows]))) < _AT_REST * usual
        return Remark("at-rest", "the wheel is at rest", severity="note") if rests else None
    torque = quantities.get("torque")
    if torque is None or not np.isfinite(torque[rows]).any():
        return None
    near_zero = _AT_REST * float(np.nanpercentile(np.abs(torque), 90))
    if float(np.nanmedian(np.abs(torque[rows]))) >= near_zero:
        return None
    if _slips(step, quantities, rows, near_zero):
        return None
    text = "the torque is near zero: the wheel is probably at rest"
    return Remark("torque-near-zero", text, ("torque",))


def _slips(
    step: float, quantities: Mapping[str, Floats], rows: NDArray[np.bool_], near_zero: float
) -> bool:
    """Whether a window without torque has a slip of its own: where a wheel begins to brake.

    It is one that varies little and is not that of the rest with which the log begins.
    """
    slip, torque = quantities.get("slip"), quantities["torque"]
    first = max(3, round(_FIRST / step))
    if slip is None or not (np.isfinite(slip[:first]).any() and np.isfinite(slip[rows]).any()):
        return False
    middle = float(np.nanmedian(slip[rows]))
    steady = float(np.nanstd(slip[rows])) < 0.5 * abs(middle)
    rests = np.isfinite(torque[:first]).any() and abs(np.nanmedian(torque[:first])) < near_zero
    return bool(steady and rests and abs(middle - float(np.nanmedian(slip[:first]))) > _OTHER_SLIP)
