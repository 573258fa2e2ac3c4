"""Stances of a wheel-leg in a run: when a leg is vertical, and what its sensors read then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.remarks import Remark

#: How many times the usual difference from the median of its neighbours a wild sample has, and how
#: many neighbours on either side it is compared with.
_SPIKE, _AROUND = 8.0, 5
_MAD = 1.4826  # Standard deviation of normal values over their median absolute deviation
_MISSING = 0.2  # Largest share of missing samples in a stance
_SLOWER = 2.0  # A stance that lasts so many times as long as usual has a rest in it
#: Half of the samples over which the largest acceleration is read, and the variance of the middle
#: of a parabola through them, over that of one sample: 17/35 for five.
_PEAK, _PEAK_VARIANCE = 2, 17.0 / 35.0
_LEAST_PROMINENCE = 0.3  # Of a peak of the hub's height, over the usual range of the height


@dataclass(frozen=True)
class Stance:
    """A stance from `start` over `middle`, where its leg is vertical, to `stop`, s.

    why: Why it is left out; None where it is whole.
    """

    start: float
    middle: float
    stop: float
    why: Remark | None = None


def without_spikes(values: Floats) -> tuple[Floats, int]:
    """Samples (n,) with wild ones, single or two in a row, as NaN, and how many they were.

    A sample is wild where it is off the median of five by much more than samples usually are, and
    by more than the range of those two to five places away: a fast oscillation has no wild samples.
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2 * _AROUND + 1:
        return values, 0
    own = np.pad(values[known], _AROUND, mode="reflect")
    parts = np.lib.stride_tricks.sliding_window_view(own, 2 * _AROUND + 1)
    off = np.abs(values[known] - np.median(parts[:, _AROUND - 2 : _AROUND + 3], axis=1))
    ring = np.delete(parts, [_AROUND - 1, _AROUND, _AROUND + 1], axis=1)
    usual = _MAD * float(np.median(off[off > 0.0])) if np.any(off > 0.0) else np.inf
    wild = known[(off > _SPIKE * usual) & (off > np.ptp(ring, axis=1))]
    found = values.copy()
    found[wild] = np.nan
    return found, int(wild.size)


def midstances_of_height(time: Floats, height: Floats) -> Floats:
    """Times of midstances, s, from the height of the hub or the pitch of its arm (n,).

    The hub is highest where a leg is vertical. Peaks are those of the height smoothed over a
    quarter of the usual stance, which is the strongest period of the run. Empty for fewer than
    three stances, and where nothing is periodic.
    """
    from scipy.signal import find_peaks

    known = np.isfinite(height)
    if known.sum() < 16:
        return np.empty(0)
    filled = np.interp(time, time[known], height[known])
    line = np.polyval(np.polyfit(time, filled, 1), time)
    power = np.abs(np.fft.rfft((filled - line) * np.hanning(time.size))) ** 2
    power[:3] = 0.0  # fewer than three stances
    strongest = int(np.argmax(power))
    if strongest == 0:
        return np.empty(0)
    period = time.size / strongest  # samples
    width = max(3, round(period / 4.0))
    kernel = np.hanning(width + 2)[1:-1]
    smooth = np.convolve(filled - line, kernel / kernel.sum(), "same")
    spread = float(np.diff(np.percentile(smooth, [10, 90]))[0])
    peaks, _ = find_peaks(smooth, distance=0.6 * period, prominence=_LEAST_PROMINENCE * spread)
    inner = peaks[(peaks >= width) & (peaks < time.size - width)]
    return np.asarray([_vertex(time, smooth, int(p), max(1, width // 4)) for p in inner])


def _vertex(time: Floats, values: Floats, peak: int, half: int) -> float:
    """Where the parabola through the samples around a peak is highest."""
    own = slice(max(0, peak - half), peak + half + 1)
    a, b, _ = np.polyfit(time[own] - time[peak], values[own], 2)
    limit = half * float(time[1] - time[0])
    return float(time[peak] + np.clip(-b / (2.0 * a) if a < 0.0 else 0.0, -limit, limit))


def zero_of(time: Floats, angle: Floats, middles: Floats, spacing: float) -> float:
    """Angle at midstance, rad: the circular mean over a spacing of `angle` (n,) at `middles`."""
    known = np.isfinite(angle)
    turned = np.interp(middles, time[known], angle[known]) * 2.0 * np.pi / spacing
    return float(np.angle(np.mean(np.exp(1j * turned))) * spacing / (2.0 * np.pi))


def stances_of(time: Floats, angle: Floats, spacing: float) -> list[Stance]:
    """Stances of a run from the angle (n,) since a midstance, growing with the motion, rad.

    A stance lasts from half a spacing before its midstance to half a spacing after it.
    """
    known = np.isfinite(angle)
    if known.sum() < 2:
        return []
    reached = np.maximum.accumulate(angle[known])
    moves = np.diff(reached) > 0.0
    at = time[known]
    # where the wheel rests at an end, a stance begins after and stops before it
    turned, first = reached[np.r_[True, moves]], at[np.r_[True, moves]]
    last = at[np.r_[moves, True]]
    edges = spacing * (np.arange(np.ceil(turned[0] / spacing - 0.5),
                                 np.floor(turned[-1] / spacing + 0.5)) + 0.5)  # fmt: skip
    edges = edges[(edges >= turned[0]) & (edges <= turned[-1])]
    if edges.size < 2:
        return []
    starts, stops = np.interp(edges[:-1], turned, last), np.interp(edges[1:], turned, first)
    middles = np.interp(edges[:-1] + spacing / 2.0, turned, first)
    usual = float(np.median(stops - starts))
    found = []
    for start, stop, middle in zip(map(float, starts), map(float, stops), middles, strict=True):
        inside = (time >= start) & (time <= stop)
        missing = float(np.mean(~known[inside])) if inside.any() else 1.0
        why = None
        if missing > _MISSING:
            text = f"{missing:.0%} of the angle is missing in this stance"
            why = Remark("missing-samples", text, ("wheel_angle",))
        elif stop - start > _SLOWER * usual:
            text = f"the stance lasts {stop - start:.3g} s, usual are {usual:.3g} s: it has a rest"
            why = Remark("at-rest", text, severity="note")
        found.append(Stance(start, float(middle), stop, why))
    return found


def noise_of(values: Floats) -> float:
    """Standard deviation of the noise of samples (n,), by their second differences."""
    bends = np.diff(values, 2)
    bends = bends[np.isfinite(bends)]
    return float(_MAD * np.median(np.abs(bends)) / np.sqrt(6.0)) if bends.size else float("nan")


def amplitude(acceleration: Floats, noise: float) -> tuple[float, float]:
    """Largest size of an acceleration (n,) and its standard error; NaN where a fifth is missing.

    It is that of parabolas through five samples, whose error is 0.7 of the `noise` of one. Below
    some three times the noise it is the noise that is largest.
    """
    if acceleration.size < 2 * _PEAK + 1:
        return float("nan"), float("nan")
    parts = np.lib.stride_tricks.sliding_window_view(acceleration, 2 * _PEAK + 1)
    middles = parts @ (np.asarray([-3.0, 12.0, 17.0, 12.0, -3.0]) / 35.0)
    whole: NDArray[np.bool_] = np.isfinite(middles)
    if np.mean(~np.isfinite(acceleration)) > _MISSING or not whole.any():
        return float("nan"), float("nan")
    return float(np.abs(middles[whole]).max()), noise * _PEAK_VARIANCE**0.5
