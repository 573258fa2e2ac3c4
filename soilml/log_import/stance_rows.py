"""One row of the table for each stance of a wheel-leg."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.mapping.log_map import LeaveOut, WheelLegMap, WheelMap, WindowSettings
from soilml.log_import.rows import AVERAGED, WindowRow
from soilml.log_import.windows.mean_errors import mean_error
from soilml.log_import.windows.stances import (
    Stance,
    amplitude,
    midstances_of_height,
    noise_of,
    stances_of,
    zero_of,
)
from soilml.log_import.windows.steady import Stretch
from soilml.remarks import Remark

#: Share of a stance at each of its ends over which a line through places tells the place there.
_AT_ENDS = 0.15
#: How many times as wide as that of the means the stretch is that tells their scatter: that of the
#: means has few independent samples.
_WIDER = 4.0


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
