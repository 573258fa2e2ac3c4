"""Rotation and travel of a map from which no slip can follow, with the likely cause."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.mapping.channel_map import UNITS
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.units import factor

#: Units that loggers write, by channel; and travel over rim speed, at the lowest slip and in the
#: middle of the windows, that a wheel may have.
_SPEEDS, _ANGLES = ("m/s", "cm/s", "mm/s", "km/h"), ("rad/s", "rpm", "deg/s")
_WRITTEN = {
    "wheel_speed": _ANGLES, "wheel_angle": ("rad", "deg", "turns"), "rim_speed": _SPEEDS,
    "ground_speed": _SPEEDS, "position": ("m", "cm", "mm"),
}  # fmt: skip
_FASTEST, _MIDDLE = (0.55, 1.12), (0.4, 1.2)
#: Share of the rim speed from which a wheel moves, fewest rows, and how near to 1 and how constant
#: travel over rim speed is where one is computed from the other.
_MOVES, _FEWEST, _ODOMETRY, _RESOLUTION = 0.2, 3, 0.03, 1e-3
#: Slips that are alike, and the ratio of the largest to the least effort that one slip seldom has:
#: at a slip of 0.3 loads of 20 to 150 N give 1.2.
_ALIKE, _WORKS = 0.01, 1.4


def slip_without_cause(ratio: Floats, effort: Floats) -> bool:
    """Whether travel over rotation stays the same while the wheel works more and less.

    ratio, effort: Travel over rotation, and torque over load, (n,), in any unit. A wheel slips more
    where it pulls more; the odometry of wheels shows one slip, whatever the radius it has.
    """
    good = np.isfinite(ratio) & np.isfinite(effort)
    if good.sum() < _FEWEST:
        return False
    low, high = (float(x) for x in np.percentile(np.abs(effort[good]), [5, 95]))
    own = np.abs(ratio[good])
    return high > _WORKS * low and float(np.std(own)) < _ALIKE / 2.0 * float(np.median(own))


def rate_hints(
    wheel: WheelMap, rim: Floats, ground: Floats, effort: Floats
) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Code, text and channels of what is wrong.

    rim, ground: Speeds of rim and travel (rows,), m/s, in the sensors' own direction.
    effort: Torque over load (rows,), m; NaN where it is not known.
    """
    channels = wheel.channels
    rotation = next((r for r in ("rim_speed", "wheel_angle", "wheel_speed") if r in channels), "")
    good = np.isfinite(rim) & np.isfinite(ground) & (rim != 0.0)
    if "slip" in channels or not rotation or not good.any():
        return
    ratio = ground[good] / rim[good]
    travel = "position" if "position" in channels else "ground_speed"
    if why := _one_sensor(wheel, rotation, travel, rim[good], ratio, effort[good]):
        text = f"{why}; needed is a travel from another sensor, or [slip]"
        yield "one-sensor", text, (rotation, travel)
        return
    if float(np.median(ratio)) < -0.02:
        text = (
            f"travel and rotation have opposite signs in {np.mean(ratio < 0.0):.0%} of windows: "
            f"write reverse = true in [{travel}] or in [{rotation}]"
        )
        yield "sign", text, (travel, rotation)
        ratio = np.abs(ratio)
    middle, fastest = float(np.median(ratio)), float(np.max(ratio))
    if 0.0 < fastest < 0.3:
        excess = f"{1.0 / fastest:.3g}"
        cause = _other_units(wheel, (rotation, travel), fastest, _FASTEST) or (
            f"probably it was measured before a gearbox of up to {excess} to 1 (write gear_ratio "
            f"in [{rotation}]), or its unit is wrong"
        )
        if wheel.radius is not None and wheel.radius.value > 2.0:
            cause = "probably the radius is in mm"
        text = (
            f"slip is {1.0 - fastest:.4g} or more in all windows: the rim would be {excess} times "
            f"as fast as the travel; {cause}"
        )
        yield "rotation-too-fast", text, (rotation,)
    elif middle > 3.0:
        gear = channels[rotation].gear_ratio.value
        cause = _other_units(wheel, (rotation, travel), middle, _MIDDLE)
        if not cause and gear > 1.0 and middle > 0.4 * gear:
            cause = f"probably [{rotation}] was measured after the gearbox; remove gear_ratio"
        cause = cause or f"probably the unit of [{travel}] or of [{rotation}] is wrong"
        shown = f"travel is {middle:.3g} times as fast as the rim in the middle of the windows"
        yield "travel-too-fast", f"{shown}; {cause}", (travel, rotation)
    elif 0.3 <= fastest < 0.55 and ratio.size > 2 and np.ptp(ratio) > 0.02:
        radius = wheel.radius.value if wheel.radius else math.nan
        text = (
            f"slip is {1.0 - fastest:.2g} or more in all windows; was the radius of {radius:g} m "
            "measured as diameter?"
        )
        yield "radius-as-diameter", text, ("radius",)


def _one_sensor(
    wheel: WheelMap, rotation: str, travel: str, rim: Floats, ratio: Floats, effort: Floats
) -> str:
    """Why rotation and travel are one measurement, from which no slip follows; "" where two are.

    rim, ratio: Rim speed and travel over it (n,). The travel of an odometry of the wheels is r
    omega within its resolution, also where the speed or the `effort` changes.
    """
    ours, theirs = wheel.channels[rotation].columns, wheel.channels[travel].columns
    if {*ours} & {*theirs}:
        both = f"[{rotation}] and [{travel}] are both of the column {theirs[0]!r}"
        return f"{both}: slip is a constant by construction"
    moves = np.abs(rim) > _MOVES * float(np.max(np.abs(rim), initial=0.0))
    if not ours or not theirs or moves.sum() < _FEWEST:
        return ""
    rim, ratio = np.abs(rim[moves]), ratio[moves]
    middle = float(np.median(ratio))
    changes = float(np.std(rim)) > 10.0 * _RESOLUTION * float(np.median(rim))
    changes |= slip_without_cause(ratio, effort[moves]) or float(np.ptp(ratio)) == 0.0
    if abs(middle - 1.0) >= _ODOMETRY or float(np.std(ratio)) >= _RESOLUTION or not changes:
        return ""
    return (
        f"the travel is {middle:.4g} times the rim speed in all {int(moves.sum())} windows: "
        f"[{travel}] seems to be computed from the rotation, so that slip is 0 by construction"
    )


def _other_units(
    wheel: WheelMap, roles: tuple[str, str], ratio: float, plausible: tuple[float, float]
) -> str:
    """The units by which travel over rim speed would be that of a wheel; "" for none.

    roles: Rotation and travel. ratio: With the units that the map has.
    """
    found = []
    for role, power in zip(roles, (-1, 1), strict=True):
        read = wheel.channels[role].unit or UNITS[role]
        for meant in _WRITTEN[role] if not wheel.channels[role].has_scale else ():
            larger = factor(meant, UNITS[role]) / factor(read, UNITS[role])
            if plausible[0] < ratio * larger**power < plausible[1]:
                found.append(f"[{role}] is in {meant}, and was read as {read}")
    return f"probably {', or '.join(found)}" if found else ""
