"""One row of the table for each stance of a wheel-leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

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
    angle_of_midstances,
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
    leg = wheel.leg
    assert leg is not None
    angle = leg_angle(inputs, wheel, leg)
    if "clearance" in inputs.values:
        lean = leg.length.value * (1.0 - np.cos(_since(angle, leg)))
        inputs.values["clearance"] = inputs.values["clearance"] + lean
    if "vibration" in inputs.values:
        shaking = _shaking(inputs.values["vibration"], angle, inputs, leg)
        inputs.values["vibration"] = shaking
    return angle


def _since(angle: Floats, leg: WheelLegMap) -> Floats:
    """Angle (n,) from the nearest midstance, rad, between plus and minus half a spacing."""
    return angle - leg.spacing * np.round(angle / leg.spacing)


def leg_angle(inputs: Inputs, wheel: WheelMap, leg: WheelLegMap) -> Floats:
    """Angle (n,) since a midstance, rad, growing with the motion.

    From the encoder, whose angle at midstance is `zero` of the map or that at which the hub is
    highest; without one from the height of the hub alone: [clearance], else the pitch [slope].
    Raises `InputError` where neither tells it.
    """
    height = inputs.values.get("clearance", inputs.values.get("slope"))
    middles = np.empty(0) if height is None else midstances_of_height(inputs.time, height)
    turned = _turned(inputs, wheel)
    if turned is None:
        if middles.size < 2:
            raise InputError(
                "no stance is seen: needed is [wheel_angle], or a height of the hub that varies "
                "with the stances, by [clearance] or the pitch [slope]"
            )
        return angle_of_midstances(inputs.time, middles, leg.spacing)
    zero = leg.zero
    if zero is None:
        if middles.size < 2:
            raise InputError(
                "[wheel_leg] zero is missing; needed is the angle at which a leg points straight "
                "down, such as '12 deg', or [clearance] or [slope], which show where the hub is "
                "highest"
            )
        zero = zero_of(inputs.time, turned, middles, leg.spacing)
    known = turned[np.isfinite(turned)]
    return (turned - zero) * (1.0 if known.size == 0 or known[-1] >= known[0] else -1.0)


def _turned(inputs: Inputs, wheel: WheelMap) -> Floats | None:
    """Angle (n,) of the wheel, rad, behind its gearbox; None without a sensor of its rotation."""
    for role in ("wheel_angle", "wheel_speed"):
        if role in wheel.channels and (role in inputs.places or role in inputs.values):
            ratio = wheel.channels[role].gear_ratio.value
            if role in inputs.places:
                return inputs.places[role] / ratio
            speed = np.nan_to_num(inputs.values[role]) / ratio
            return np.asarray(np.cumsum(speed) * inputs.step)
    return None


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
    wheel, leg = conversion.wheel, conversion.wheel.leg
    assert leg is not None
    shaking = inputs.values.get("vibration")
    noise = float("nan") if shaking is None else noise_of(shaking)
    low, high = windows.within
    out, rows = [], []
    stances = stances_of(inputs.time, angle, leg.spacing)
    late = 0.0 if _turned(inputs, wheel) is not None else _timing_error(stances)
    for stance in stances:
        stretch = Stretch(stance.start, stance.stop, stance.why)
        for entry in left_out:
            if entry.start < stance.stop and entry.stop > stance.start:
                why = Remark("left-out-by-map", entry.why, severity="note")
                stretch = replace(stretch, why=why)
        if stance.stop <= low or stance.start >= high:
            why = Remark("outside", "outside of [windows] within", severity="note")
            stretch = replace(stretch, why=why)
        if stretch.why:
            out.append(stretch)
            continue
        row = _row(stance, stretch, inputs, series, angle, conversion)
        if late and "slip" in row.std:
            row.std["slip"] = float(np.hypot(row.std["slip"], late / (stance.stop - stance.start)))
        after = (inputs.time >= stance.middle) & (inputs.time <= stance.stop)
        if shaking is not None:
            row.values["vibration"], row.std["vibration"] = amplitude(shaking[after], noise)
        rows.append(row)
    return out, rows


def _timing_error(stances: Sequence[Stance]) -> float:
    """Standard deviation of midstances that the height of the hub shows, s, by their spacing.

    As a share of the duration of a stance it is an error of its slip.
    """
    bends = np.diff([stance.middle for stance in stances], 2)
    return float(np.sqrt(np.mean(bends**2) / 6.0)) if bends.size else 0.0


def _shaking(read: Floats, angle: Floats, inputs: Inputs, leg: WheelLegMap) -> Floats:
    """Vertical acceleration (n,) less gravity and that of a rigid leg, m/s^2."""
    rate = float(np.median(np.gradient(np.nan_to_num(angle), inputs.step)))
    rigid = -leg.length.value * rate**2 * np.cos(np.nan_to_num(_since(angle, leg)))
    return np.asarray(read - rigid - float(np.nanmedian(read - rigid)))


def _row(
    stance: Stance,
    stretch: Stretch,
    inputs: Inputs,
    series: Mapping[str, Floats],
    angle: Floats,
    conversion: Conversion,
) -> WindowRow:
    """The row of a stance, without its vibration."""
    wheel, leg = conversion.wheel, conversion.wheel.leg
    assert leg is not None
    turned = np.interp(stance.middle, inputs.time, np.nan_to_num(angle))
    middle = np.abs(angle - turned) <= leg.half_width
    means: dict[str, float] = dict(inputs.constants)
    for role, values in inputs.values.items():
        known = values[middle][np.isfinite(values[middle])]
        enough = known.size > 0.5 * np.sum(middle) > 0
        means[role] = float(known.mean()) if enough else float("nan")
    std: dict[str, float] = {}
    reach = np.sin(angle - turned)
    advance, advance_error = _advance(stance, inputs, reach)
    if "slip" in inputs.values:
        own = (inputs.time >= stance.start) & (inputs.time <= stance.stop)
        means["slip"], std["slip"], _ = mean_error(inputs.values["slip"][own], inputs.step)
    elif advance is not None:
        lasts, chord = stance.stop - stance.start, 2.0 * np.sin(leg.spacing / 2.0)
        ratio = _gear_ratio(wheel)
        means["ground_speed"], means["wheel_speed"] = advance / lasts, ratio * chord / lasts
        std["slip"] = advance_error / (chord * leg.length.value)
    else:
        means.pop("wheel_speed", None)
    found = {k: float(v) for k, v in conversion.of(means).items()}
    for name in AVERAGED:
        if name in series and np.isfinite(series[name][middle]).any():
            wide = np.abs(angle - turned) <= _WIDER * leg.half_width
            error = _WIDER**0.5 * _scatter(series[name][wide], reach[wide], inputs.step)
            if error > 1e-12 * abs(found.get(name, 0.0)):
                std[name] = error
    return WindowRow(stretch, means, found, std)


def _scatter(values: Floats, reach: Floats, step: float) -> float:
    """Standard error of the mean of samples (n,) off a parabola of sin(theta) through them."""
    known = np.isfinite(values)
    if known.sum() < 8 or np.ptp(values[known]) == 0.0:
        return 0.0
    curve = np.polynomial.Polynomial.fit(reach[known], values[known], 2)
    return mean_error(np.where(known, values - curve(reach), np.nan), step)[1]


def _gear_ratio(wheel: WheelMap) -> float:
    for role in ("wheel_angle", "wheel_speed"):
        if role in wheel.channels:
            return wheel.channels[role].gear_ratio.value
    return 1.0


def _advance(stance: Stance, inputs: Inputs, reach: Floats) -> tuple[float | None, float]:
    """How far the hub advances in a stance, m, and the standard error; None where nothing says it.

    At each end it is a line through the places of this stance over sin(theta), to which they are
    proportional at a constant slip (eq. 11); the next stance has another slip.
    """
    lasts = stance.stop - stance.start
    if "position" in inputs.places:
        places, part = inputs.places["position"], _AT_ENDS * lasts
        ends = (stance.start, stance.start + part), (stance.stop - part, stance.stop)
        at = np.interp([stance.start, stance.stop], inputs.time, np.nan_to_num(reach))
        first, last = (
            _line_at(inputs, places, reach, *end, x) for end, x in zip(ends, at, strict=True)
        )
        return abs(last[0] - first[0]), float(np.hypot(first[1], last[1]))
    speed = inputs.values.get("ground_speed")
    if speed is None:
        constant = inputs.constants.get("ground_speed")
        return (None, 0.0) if constant is None else (abs(constant) * lasts, 0.0)
    mean, error = _line_at(inputs, speed, reach, stance.start, stance.stop, 0.0)
    return abs(mean) * lasts, error * lasts


def _line_at(
    inputs: Inputs, values: Floats, over: Floats, start: float, stop: float, at: float
) -> tuple[float, float]:
    """The line through the samples of a stretch over another one, where that is `at`; its error."""
    inside = (inputs.time >= start) & (inputs.time <= stop) & np.isfinite(values + over)
    if inside.sum() < 8 or np.ptp(over[inside]) == 0.0:
        return float("nan"), float("nan")
    own = over[inside] - at
    line = np.polyfit(own, values[inside], 1)
    error = mean_error(values[inside] - np.polyval(line, own), inputs.step)[1]
    lever = own.mean() ** 2 / own.var()  # beside that of the mean, the error of the slope
    return float(line[1]), error * float(np.sqrt(1.0 + lever))
