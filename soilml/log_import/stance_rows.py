"""Stances of a wheel-leg: when a leg is vertical, and the row of the table that each becomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.mapping.log_map import LeaveOut, WheelLegMap, WheelMap, WindowSettings
from soilml.log_import.rows import AVERAGED, WindowRow
from soilml.log_import.windows.mean_errors import mean_error
from soilml.log_import.windows.steady import Stretch
from soilml.remarks import Remark

#: Share of a stance at each of its ends over which a line through places tells the place there.
_AT_ENDS = 0.15
#: How many times as wide as that of the means the stretch is that tells their scatter: that of the
#: means has few independent samples.
_WIDER = 4.0
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


def without_rolling(inputs: Inputs, wheel: WheelMap) -> Floats:
    """The angle (n,) of `leg_angle`; the rolling of a rigid leg is taken out of the channels.

    The hub of a leg that leans by theta is lower by l (1 - cos theta), eq. 10: [clearance] becomes
    what it were with the leg vertical, and [vibration] what is left without gravity.
    Raises `InputError` where nothing tells the angle.
    """
    leg, values = wheel.leg, inputs.values
    assert leg is not None
    angle = leg_angle(inputs, wheel, leg)
    # from the nearest midstance, between plus and minus half a spacing
    upright = np.cos(angle - leg.spacing * np.round(angle / leg.spacing))
    if "clearance" in values:
        values["clearance"] = values["clearance"] + leg.length.value * (1.0 - upright)
    if "vibration" in values:
        rate = float(np.median(np.gradient(np.nan_to_num(angle), inputs.step)))
        rigid = -leg.length.value * rate**2 * np.where(np.isfinite(upright), upright, 1.0)
        shaking = values["vibration"] - rigid
        values["vibration"] = np.asarray(shaking - float(np.nanmedian(shaking)))
    return angle


def leg_angle(inputs: Inputs, wheel: WheelMap, leg: WheelLegMap) -> Floats:
    """Angle (n,) since a midstance, rad, growing with the motion.

    From the encoder, whose angle at midstance is `zero` of the map or that at which the hub is
    highest; without one from the height of the hub alone: [clearance], else the pitch [slope].
    Raises `InputError` where neither tells it.
    """
    height = inputs.values.get("clearance", inputs.values.get("slope"))
    middles = np.empty(0) if height is None else midstances_of_height(inputs.time, height)
    role = _turning(inputs)
    if role and (leg.zero is not None or middles.size >= 2):
        ratio = wheel.channels[role].gear_ratio.value
        if role in inputs.places:
            turned = inputs.places[role] / ratio
        else:
            turned = np.cumsum(np.nan_to_num(inputs.values[role]) / ratio) * inputs.step
        zero = leg.zero
        if zero is None:
            zero = zero_of(inputs.time, turned, middles, leg.spacing)
        known = turned[np.isfinite(turned)]
        forward = known.size == 0 or known[-1] >= known[0]
        return np.asarray((turned - zero) * (1.0 if forward else -1.0))
    if role:
        raise InputError(
            "[wheel_leg] zero is missing; needed is the angle at which a leg points straight down, "
            "such as '12 deg', or [clearance] or [slope], which show where the hub is highest"
        )
    if middles.size < 2:
        raise InputError(
            "no stance is seen: needed is [wheel_angle], or a height of the hub that varies with "
            "the stances, by [clearance] or the pitch [slope]"
        )
    # linear between midstances, NaN outside of them
    angles = leg.spacing * np.arange(middles.size)
    return np.asarray(np.interp(inputs.time, middles, angles, left=np.nan, right=np.nan))


def _turning(inputs: Inputs) -> str:
    """The channel of the rotation that was given; "" without a sensor of it."""
    if "wheel_angle" in inputs.places:
        return "wheel_angle"
    return "wheel_speed" if "wheel_speed" in inputs.values else ""


def stance_rows(
    inputs: Inputs,
    angle: Floats,
    series: Mapping[str, Floats],
    conversion: Conversion,
    windows: WindowSettings,
    left_out: tuple[LeaveOut, ...] = (),
) -> tuple[list[Stretch], list[WindowRow]]:
    """The stances of a run: what is left out with the reason, and the rows of the others.

    Torque, load and sinkage are means around midstance, with standard errors that know the
    autocorrelation. Slip is that of the whole stance, over which a leg of length l that does not
    slip advances by 2 l sin(pi / legs). Vibration is the largest acceleration of the hub after
    midstance. References: Comin and Saaj 2017, eqs. 10, 11 and section III-C.
    """
    leg = conversion.wheel.leg
    assert leg is not None
    shaking = inputs.values.get("vibration")
    noise = float("nan") if shaking is None else noise_of(shaking)
    low, high = windows.within
    out, rows = [], []
    stances = stances_of(inputs.time, angle, leg.spacing)
    # of midstances that the height of the hub shows, by their spacing, s: an error of the slip as a
    # share of the duration of a stance
    bends = np.diff([stance.middle for stance in stances], 2)
    by_height = bends.size and not _turning(inputs)
    late = float(np.sqrt(np.mean(bends**2) / 6.0)) if by_height else 0.0
    for stance in stances:
        lasts, why = stance.stop - stance.start, stance.why
        for entry in left_out:
            if entry.start < stance.stop and entry.stop > stance.start:
                why = Remark("left-out-by-map", entry.why, severity="note")
        if stance.stop <= low or stance.start >= high:
            why = Remark("outside", "outside of [windows] within", severity="note")
        if why:
            out.append(Stretch(stance.start, stance.stop, why))
            continue
        row = _row(stance, inputs, series, angle, conversion, leg)
        if late and "slip" in row.std:
            row.std["slip"] = float(np.hypot(row.std["slip"], late / lasts))
        if shaking is not None:
            after = inputs.within(stance.middle, stance.stop)
            row.values["vibration"], row.std["vibration"] = amplitude(shaking[after], noise)
        rows.append(row)
    return out, rows


def _row(
    stance: Stance,
    inputs: Inputs,
    series: Mapping[str, Floats],
    angle: Floats,
    conversion: Conversion,
    leg: WheelLegMap,
) -> WindowRow:
    """The row of a stance, without its vibration."""
    turned = np.interp(stance.middle, inputs.time, np.nan_to_num(angle))
    middle = np.abs(angle - turned) <= leg.half_width
    means: dict[str, float] = dict(inputs.constants)
    for role, values in inputs.values.items():
        known = values[middle][np.isfinite(values[middle])]
        enough = known.size > 0.5 * np.sum(middle) > 0
        means[role] = float(known.mean()) if enough else float("nan")
    std: dict[str, float] = {}
    reach = np.sin(angle - turned)
    advance, error = _advance(stance, inputs, reach)
    if "slip" in inputs.values:
        own = inputs.within(stance.start, stance.stop)
        means["slip"], std["slip"], _ = mean_error(inputs.values["slip"][own], inputs.step)
    elif advance is not None:
        lasts, chord = stance.stop - stance.start, 2.0 * np.sin(leg.spacing / 2.0)
        channels = conversion.wheel.channels
        turning = channels.get("wheel_angle", channels.get("wheel_speed"))
        ratio = turning.gear_ratio.value if turning is not None else 1.0
        means["ground_speed"], means["wheel_speed"] = advance / lasts, ratio * chord / lasts
        std["slip"] = error / (chord * leg.length.value)
    else:
        means.pop("wheel_speed", None)
    found = {k: float(v) for k, v in conversion.of(means).items()}
    wide = np.abs(angle - turned) <= _WIDER * leg.half_width
    for name in AVERAGED:
        if name in series and np.isfinite(series[name][middle]).any():
            error = _WIDER**0.5 * _scatter(series[name][wide], reach[wide], inputs.step)
            if error > 1e-12 * abs(found.get(name, 0.0)):
                std[name] = error
    return WindowRow(Stretch(stance.start, stance.stop), means, found, std)


def _scatter(values: Floats, reach: Floats, step: float) -> float:
    """Standard error of the mean of samples (n,) off a parabola of sin(theta) through them."""
    known = np.isfinite(values)
    if known.sum() < 8 or np.ptp(values[known]) == 0.0:
        return 0.0
    curve = np.polynomial.Polynomial.fit(reach[known], values[known], 2)
    return mean_error(np.where(known, values - curve(reach), np.nan), step)[1]


def _advance(stance: Stance, inputs: Inputs, reach: Floats) -> tuple[float | None, float]:
    """How far the hub advances in a stance, m, and the standard error; None where nothing says it.

    At each end it is a line through the places of this stance over sin(theta), to which they are
    proportional at a constant slip (eq. 11); the next stance has another slip.
    """
    start, stop = stance.start, stance.stop
    if "position" in inputs.places:
        places, part = inputs.places["position"], _AT_ENDS * (stop - start)
        at = np.interp([start, stop], inputs.time, np.nan_to_num(reach))
        first = _line_at(inputs, places, reach, start, start + part, at[0])
        last = _line_at(inputs, places, reach, stop - part, stop, at[1])
        return abs(last[0] - first[0]), float(np.hypot(first[1], last[1]))
    mean, error = inputs.constants.get("ground_speed"), 0.0
    if "ground_speed" in inputs.values:
        mean, error = _line_at(inputs, inputs.values["ground_speed"], reach, start, stop, 0.0)
    return (None, 0.0) if mean is None else (abs(mean) * (stop - start), error * (stop - start))


def _line_at(
    inputs: Inputs, values: Floats, over: Floats, start: float, stop: float, at: float
) -> tuple[float, float]:
    """The line through the samples of a stretch over another one, where that is `at`; its error."""
    inside = inputs.within(start, stop) & np.isfinite(values + over)
    if inside.sum() < 8 or np.ptp(over[inside]) == 0.0:
        return float("nan"), float("nan")
    own = over[inside] - at
    line = np.polyfit(own, values[inside], 1)
    error = mean_error(values[inside] - np.polyval(line, own), inputs.step)[1]
    lever = own.mean() ** 2 / own.var()  # beside that of the mean, the error of the slope
    return float(line[1]), error * float(np.sqrt(1.0 + lever))
