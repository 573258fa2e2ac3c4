"""Stances of a wheel-leg: the windows of a wheel whose rim moves as its legs swing.

While a leg of length l stands, the hub of a wheel-leg that does not slip advances by l sin(theta)
from midstance on (Comin and Saaj 2017, eq. 11): with the angle of its encoder replaced by that
advance over l, it is a wheel of the radius l.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.log_import.channels.inputs import SMOOTH, Inputs
from soilml.log_import.channels.resampling import derivative
from soilml.log_import.mapping.log_map import LeaveOut, WheelMap
from soilml.log_import.windows.steady import Stretch, searched_parts
from soilml.remarks import Remark

_MISSING = 0.2  # Largest share of missing samples in a stance
_SLOWER = 2.0  # A stance that lasts so many times as long as usual has a rest in it
_WHOLE, _AT_REST = 0.95, 0.01  # Least part of a stance that is seen, and what is no motion yet
#: How many times the usual difference from its neighbours a wild sample has, and how many of them
#: on either side it is compared with.
_WILD, _BESIDE = 12.0, 5
_DESPIKED = ("torque", "motor_current", "load", "clearance", "vibration")


def leg_angle(inputs: Inputs, wheel: WheelMap) -> Floats:
    """Angle (n,) of a wheel-leg since its first midstance, rad, growing with the motion.

    The channels become those of a wheel: the rotation as said above, [clearance] as with the leg
    vertical (eq. 10), [vibration] without gravity, all without wild samples.
    Raises `InputError` where no encoder gives the angle.
    """
    leg, values = wheel.leg, inputs.values
    assert leg is not None
    if "wheel_angle" not in inputs.places:
        raise InputError("[wheel_leg] needs the angle of the legs: [wheel_angle] is missing")
    ratio = wheel.channels["wheel_angle"].gear_ratio.value
    angle = inputs.places["wheel_angle"] / ratio - leg.zero
    angle = angle if angle[-1] >= angle[0] else -angle
    number = np.round(angle / leg.spacing)
    since = angle - leg.spacing * number
    place = ratio * (2.0 * np.sin(leg.spacing / 2.0) * number + np.sin(since))
    inputs.places["wheel_angle"] = place
    values["wheel_speed"] = derivative(inputs.time, place, SMOOTH)
    for role in (role for role in _DESPIKED if role in values):
        values[role], count = _without_wild_samples(values[role])
        if count:
            text = f"[{role}]: {count} wild samples are left out"
            inputs.notes.append(Remark("spikes", text, (role,), severity="note"))
    if "clearance" in values:
        values["clearance"] = values["clearance"] + leg.length.value * (1.0 - np.cos(since))
    if "vibration" in values:
        values["vibration"] = values["vibration"] - float(np.nanmedian(values["vibration"]))
    return angle


def _without_wild_samples(values: Floats) -> tuple[Floats, int]:
    """Samples (n,) with wild ones, single or two in a row, as NaN, and how many they are.

    They are off the median of five by much more than samples usually are, and by more than those
    beside them vary: the peaks of an oscillation are not wild.
    """
    known, found = np.flatnonzero(np.isfinite(values)), values.copy()
    if known.size <= 2 * _BESIDE:
        return found, 0
    own = np.pad(values[known], _BESIDE, mode="reflect")
    parts = np.lib.stride_tricks.sliding_window_view(own, 2 * _BESIDE + 1)
    off = np.abs(values[known] - np.median(parts[:, _BESIDE - 2 : _BESIDE + 3], axis=1))
    beside = np.delete(parts, [_BESIDE - 1, _BESIDE, _BESIDE + 1], axis=1)
    usual = float(np.median(off[off > 0.0])) if np.any(off > 0.0) else np.inf
    wild = known[(off > _WILD * usual) & (off > np.ptp(beside, axis=1))]
    found[wild] = np.nan
    return found, int(wild.size)


def stances(
    inputs: Inputs,
    angle: Floats,
    wheel: WheelMap,
    left_out: tuple[LeaveOut, ...],
) -> Iterator[tuple[Stretch, Stretch]]:
    """Each stance of a run, and its part around midstance, where sensors are averaged.

    angle: What `leg_angle` gives. A stance lasts from half a spacing before midstance to half a
    spacing after it; where it is left out, its first stretch says why.
    """
    leg, time = wheel.leg, inputs.time
    assert leg is not None
    reached = np.maximum.accumulate(np.where(np.isfinite(angle), angle, -np.inf))
    edge, found = _AT_REST * leg.spacing, []
    for k in np.unique(np.round(reached[np.isfinite(reached)] / leg.spacing)):
        since = reached - k * leg.spacing
        own = time[np.abs(since) < leg.spacing / 2.0 - edge]
        middle = time[np.abs(since) <= leg.half_width]
        inside = np.abs(since) <= leg.spacing / 2.0
        if own.size and middle.size and np.ptp(since[inside]) > _WHOLE * leg.spacing:
            missing = float(np.mean(~np.isfinite(angle[inside])))
            ends = Stretch(float(own[0]), float(own[-1]))
            found.append((ends, Stretch(float(middle[0]), float(middle[-1])), missing))
    left = searched_parts(time, left_out)[1]
    usual = float(np.median([s.stop - s.start for s, _, _ in found])) if found else 0.0
    for whole, middle, missing in found:
        lasts, why = whole.stop - whole.start, None
        if missing > _MISSING:
            text = f"{missing:.0%} of the angle is missing in this stance"
            why = Remark("missing-samples", text, ("wheel_angle",))
        elif lasts > _SLOWER * usual:
            text = f"the stance lasts {lasts:.3g} s, usual are {usual:.3g} s: it has a rest"
            why = Remark("at-rest", text, severity="note")
        why = next(
            (out.why for out in left if out.start < whole.stop and out.stop > whole.start), why
        )
        yield Stretch(whole.start, whole.stop, why), middle


def largest_acceleration(inputs: Inputs, stance: Stretch, within: Stretch) -> tuple[float, float]:
    """Largest size of the vertical acceleration after midstance, and its error; NaN without one.

    That of one sample is the noise, by the second differences of all samples. The end of the
    stance, which is no part of its stretch, counts: a leg that slips by jerks shakes most there.
    """
    values, lasts = inputs.values["vibration"], stance.stop - stance.start
    end = stance.stop + lasts * _AT_REST / (1.0 - 2.0 * _AT_REST)
    own = values[inputs.within((within.start + within.stop) / 2.0, end)]
    if np.mean(~np.isfinite(own)) > _MISSING:
        return float("nan"), float("nan")
    bends = np.abs(np.diff(values, 2))
    noise = 1.4826 * float(np.nanmedian(bends)) / 6.0**0.5
    return float(np.nanmax(np.abs(own))), noise
