"""Windows of a log that look as if its map were wrong, with the likely cause."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.checks.slip_definition import definition_by_speeds
from soilml.log_import.checks.table_hints import MOST_TRACTION, falls_with_slip, traction_cause
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.units import spelling
from soilml.remarks import Remark

#: Ratio of what was read to what is meant, for rotations; and for travel.
_ROTATION = (
    (180.0 / math.pi, "deg"),
    (30.0 / math.pi, "rpm"),
    (2.0 * math.pi, "turns"),
    (6.0, "deg/s, and was read as rpm"),
)
_SLOW_ROTATION = (
    (6.0, "deg/s", "rpm"),
    (180.0 / math.pi, "deg/s", "rad/s"),
    (180.0 / math.pi, "deg", "rad"),
    (30.0 / math.pi, "rpm", "rad/s"),
)
#: Largest pull over load, lever arm of torque over load, m, and sinkage, m, of any wheel.
_MOST_PULL, _MOST_LEVER, _MOST_SINKAGE = 1.2, 0.8, 0.7
_FAR_FROM_WEIGHT = 2.5  # Factor between a load and its share of the mass that no slope explains
#: Share of the rim speed from which a wheel moves, fewest windows, and how near to 1 and how
#: constant travel over rim speed is where one is computed from the other.
_MOVES, _FEWEST, _ODOMETRY, _RESOLUTION = 0.2, 4, 0.03, 1e-3
_TRAVEL = ((1000.0, "mm"), (100.0, "cm"), (3.6, "km/h"))


def map_hints(log_map: LogMap, wheel: WheelMap, windows: dict[str, Floats]) -> list[Remark]:
    """What says that the map of a wheel is wrong.

    windows: Means of the windows (windows,) by quantity: `rim_speed` and `speed` in the sensors'
        own direction, `slip`, `torque`, `load`, `slope`.
    """
    of = f" of wheel {wheel.name}" if wheel.name else ""
    # the load follows from the slope, and T / (W r) from the load: causes come before consequences
    found = [*_slope(wheel, windows), *_ratio(log_map, wheel, windows)]
    found += [*_load(log_map, wheel, windows), *_torque(log_map, wheel, windows)]
    found += [*_pull(windows), *_sinkage(wheel, windows)]
    return [replace(hint, text=f"{log_map.source}{of}: {hint.text}") for hint in found]


def _ratio(log_map: LogMap, wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    if "slip" in wheel.channels:
        slip = windows.get("slip", np.zeros(0))
        if slip.size and float(np.nanmedian(np.abs(slip))) >= 1.0:
            yield Remark(
                "slip-unit",
                f"slip is {float(np.nanmedian(slip)):.3g} in the middle of the windows: probably "
                "it is in per cent; write unit = '%' in [slip]",
                ("slip",),
            )
        elif found := _by_speeds(wheel, windows):
            definition, unit = found
            lines = [f"definition = '{definition}'", *([f"unit = '{unit}'"] if unit else [])]
            yield Remark(
                "slip-definition",
                "slip disagrees with the speeds of rim and travel, and agrees by another "
                f"definition: write {' and '.join(lines)} in [slip]",
                ("slip",),
            )
        elif (above := slip > 1.0).any():
            yield Remark(
                "slip-definition",
                f"slip is above 1 in {int(above.sum())} of {slip.size} windows, which "
                "1 - v/(r omega) cannot be: probably the log has (r omega - v)/v; write definition "
                "= '(r omega - v)/v' in [slip]",
                ("slip",),
            )
        elif falls_with_slip(windows):
            yield Remark(
                "slip-definition",
                "torque falls as slip grows: probably the log has the ratio of travel to rim "
                "speed; write definition = 'v/(r omega)' in [slip]",
                ("slip",),
            )
        return
    roles = [r for r in ("rim_speed", "wheel_angle", "wheel_speed") if r in wheel.channels]
    # without a sensor of the rotation stances have been counted by the height of the hub
    if not {"rim_speed", "speed"} <= windows.keys() or not roles:
        return
    rim, ground = windows["rim_speed"], windows["speed"]
    good = np.isfinite(rim) & np.isfinite(ground) & (rim != 0.0)
    if not good.any():
        return
    ratio = ground[good] / rim[good]
    middle, fastest = float(np.median(ratio)), float(np.max(ratio))
    rotation = roles[0]
    travel = "position" if "position" in wheel.channels else "ground_speed"
    if why := one_sensor(wheel, rotation, travel, rim[good], ground[good]):
        yield Remark("one-sensor", why, (rotation, travel))
        return
    if middle < -0.02:
        yield Remark(
            "sign",
            f"travel and rotation have opposite signs in {np.mean(ratio < 0.0):.0%} of windows: "
            f"write reverse = true in [{travel}] or in [{rotation}]",
            (travel, rotation),
        )
        ratio = np.abs(ratio)
        middle, fastest = float(np.median(ratio)), float(np.max(ratio))
    if 0.0 < fastest < 0.3:
        yield Remark(
            "rotation-too-fast",
            f"slip is {1.0 - fastest:.4g} or more in all windows: the rim would be "
            f"{1.0 / fastest:.3g} times as fast as the travel; "
            f"{_too_fast(wheel, rotation, 1.0 / fastest)}",
            (rotation,),
        )
    elif middle > 3.0:
        yield Remark(
            "travel-too-fast",
            f"travel is {middle:.3g} times as fast as the rim in the middle of the windows; "
            f"{_too_slow(wheel, travel, rotation, middle)}",
            (travel, rotation),
        )
    elif 0.3 <= fastest < 0.55 and ratio.size > 2 and np.ptp(ratio) > 0.02:
        yield Remark(
            "radius-as-diameter",
            f"slip is {1.0 - fastest:.2g} or more in all windows; was the radius of "
            f"{wheel.radius.value if wheel.radius else math.nan:g} m measured as diameter?",
            ("radius",),
        )


def one_sensor(wheel: WheelMap, rotation: str, travel: str, rim: Floats, ground: Floats) -> str:
    """Why rotation and travel are one measurement, from which no slip follows; "" where two are.

    rim, ground: Means of windows or samples (n,), m/s. The travel of an odometry of the wheels is r
    omega within its resolution, also where the speed changes.
    """
    ours, theirs = wheel.channels[rotation].columns, wheel.channels[travel].columns
    needed = "needed is a travel from another sensor, or [slip]"
    if {*ours} & {*theirs}:
        return (
            f"[{rotation}] and [{travel}] are both of the column {theirs[0]!r}: slip is a constant "
            f"by construction; {needed}"
        )
    moves = np.abs(rim) > _MOVES * float(np.max(np.abs(rim), initial=0.0))
    if not ours or not theirs or moves.sum() < _FEWEST:
        return ""
    ratio = ground[moves] / rim[moves]
    middle = float(np.median(ratio))
    alike = abs(middle - 1.0) < _ODOMETRY and float(np.std(ratio)) < _RESOLUTION
    changes = float(np.std(rim[moves])) > 10.0 * _RESOLUTION * float(np.median(np.abs(rim[moves])))
    if not (alike and (changes or float(np.ptp(ratio)) == 0.0)):
        return ""
    return (
        f"the travel is {middle:.4g} times the rim speed in all {int(moves.sum())} windows: "
        f"[{travel}] seems to be computed from the rotation, so that slip is 0 by construction; "
        f"{needed}"
    )


def _by_speeds(wheel: WheelMap, windows: dict[str, Floats]) -> tuple[str, str] | None:
    """The definition of slip that the speeds of a map confirm; None for the stated one."""
    if not {"slip", "rim_speed", "speed"} <= windows.keys():
        return None
    slip, rim, travel = (windows[name] for name in ("slip", "rim_speed", "speed"))
    return definition_by_speeds(slip, rim, travel, wheel.channels["slip"].definition)


def _too_fast(wheel: WheelMap, rotation: str, excess: float) -> str:
    channel = wheel.channels[rotation]
    if rotation != "rim_speed" and channel.unit in ("", "rad/s", "rad", "rpm"):
        for factor, unit in _ROTATION:
            if 0.9 * factor <= excess <= 1.8 * factor and (factor == 6.0) == (
                channel.unit == "rpm"
            ):
                return f"probably [{rotation}] is in {unit}"
    if wheel.radius is not None and wheel.radius.value > 2.0:
        return "probably the radius is in mm"
    if rotation == "rim_speed":
        # at a slip of 0 to 0.5 the rim is up to twice as fast as the travel
        near = [u for f, u in _TRAVEL if 0.9 * f <= excess <= 2.0 * f]
        unit = {"mm": "mm/s", "cm": "cm/s"}.get(near[0], near[0]) if near else "another unit"
        return f"probably [rim_speed] is in {unit}, or [ground_speed] in a larger one"
    return (
        f"probably it was measured before a gearbox of up to {excess:.3g} to 1 (write gear_ratio "
        f"in [{rotation}]), or its unit is wrong"
    )


def _too_slow(wheel: WheelMap, travel: str, rotation: str, excess: float) -> str:
    likely = []
    if rotation != "rim_speed" and wheel.channels[rotation].unit:
        given = spelling(wheel.channels[rotation].unit)
        for factor, read, meant in _SLOW_ROTATION:
            if given == read and 0.4 * factor <= excess <= 1.2 * factor:
                likely.append(f"[{rotation}] is in {meant}, and was read as {read}")
    if wheel.channels[travel].unit in ("", "m", "m/s"):
        for factor, unit in _TRAVEL:
            if 0.4 * factor <= excess <= 1.2 * factor:
                rate = "/s" if travel == "ground_speed" and "/" not in unit else ""
                likely.append(f"[{travel}] is in {unit}{rate}")
    if likely:
        return f"probably {', or '.join(likely)}"
    ratio = wheel.channels[rotation].gear_ratio.value if rotation != "rim_speed" else 1.0
    if ratio > 1.0 and excess > 0.4 * ratio:
        return f"probably [{rotation}] was measured after the gearbox; remove gear_ratio"
    return f"probably the unit of [{travel}] or of [{rotation}] is wrong"


def _load(log_map: LogMap, wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    load = windows.get("load", np.zeros(0))
    load = load[np.isfinite(load)]
    if load.size == 0:
        return
    middle = float(np.median(load))
    if middle <= 0.0:
        yield Remark(
            "sign",
            f"the load is {middle:.3g} N in the middle of the windows: probably its sign is "
            "turned; write reverse = true in [load]",
            ("load",),
        )
        return
    if log_map.vehicle is not None and "load" in wheel.channels:
        weight = log_map.vehicle.mass.value * log_map.vehicle.gravity / log_map.vehicle.wheels
        if 0.7 < weight / middle / 9.80665 < 1.4:
            yield Remark(
                "unit",
                f"the load of {middle:.3g} N is a tenth of the weight: probably it is in kg; write "
                "unit = 'kgf' in [load]",
                ("load",),
            )
        elif not 1.0 / _FAR_FROM_WEIGHT < middle / weight < _FAR_FROM_WEIGHT:
            yield Remark(
                "load-not-of-mass",
                f"the load is {middle:.3g} N in the middle of the windows, and the mass of "
                f"[vehicle] gives {weight:.3g} N for each wheel: probably one of them is wrong, or "
                "the column is another force",
                ("load",),
            )


def _torque(log_map: LogMap, wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    if not {"torque", "load"} <= windows.keys():
        return
    if wheel.radius is None:
        yield from _lever(wheel, windows)
        return
    torque, load = windows["torque"], windows["load"]
    good = np.isfinite(torque) & (load > 0.0)
    if not good.any():
        return
    role = "torque" if "torque" in wheel.channels else "motor_current"
    traction = float(np.median(np.abs(torque[good]) / load[good])) / wheel.radius.value
    cause = traction_cause(traction, float(np.median(load[good])))
    if traction > MOST_TRACTION:
        ratio = wheel.channels[role].gear_ratio.value
        if ratio > 1.0 and 0.02 < traction / ratio < 1.0:
            cause = f"[{role}] is at the wheel already; remove gear_ratio"
        elif role == "motor_current" and 0.02 < traction / 1000.0 < 1.0:
            cause = "torque_constant is in mN m/A, or the current in mA"
        elif wheel.radius.value < 0.01:
            cause = "the radius is in another unit"
        yield Remark(
            "traction-out-of-range",
            f"torque is {traction:.3g} times W r in the middle of the windows: probably {cause}",
            (role, "load"),
        )
    elif cause:
        unit = wheel.channels[role].unit
        if spelling(unit) == "mN*m" and 0.02 < 1000.0 * traction < MOST_TRACTION:
            cause = f"[torque] is in N m, and was read as {unit}"
        elif role == "motor_current":
            cause = "gear_ratio or the unit of torque_constant is wrong, or the sensor is dead"
        yield Remark(
            "traction-out-of-range",
            f"torque is only {traction:.2g} times W r: probably {cause}",
            (role,),
        )
    slip = windows.get("slip", np.full(torque.shape, np.nan))
    driving = good & (slip > 0.05)
    if driving.sum() >= 2 and np.mean(torque[driving] < 0.0) > 0.6:
        yield Remark(
            "sign",
            f"torque is below zero while the wheel drives: write reverse = true in [{role}]",
            (role,),
        )


def _lever(wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    """A torque over load that no wheel has, whatever its radius."""
    torque, load = windows["torque"], windows["load"]
    good = np.isfinite(torque) & (load > 0.0)
    lever = float(np.median(np.abs(torque[good]) / load[good])) if good.any() else 0.0
    if lever > _MOST_LEVER:
        role = "torque" if "torque" in wheel.channels else "motor_current"
        yield Remark(
            "traction-out-of-range",
            f"torque over load is {lever:.3g} m in the middle of the windows, more than the radius "
            "of a wheel: probably the unit of one of them is wrong, or a column is another moment "
            "or force",
            (role, "load"),
        )


def _pull(windows: dict[str, Floats]) -> Iterator[Remark]:
    if not {"drawbar_pull", "load"} <= windows.keys():
        return
    pull, load = windows["drawbar_pull"], windows["load"]
    good = np.isfinite(pull) & (load > 0.0)
    ratio = float(np.median(np.abs(pull[good]) / load[good])) if good.any() else 0.0
    if ratio > _MOST_PULL:
        yield Remark(
            "pull-out-of-range",
            f"drawbar pull is {ratio:.3g} times the load in the middle of the windows, more than "
            "soil can give: probably one of them is in another unit, was not tared, or is another "
            "force",
            ("load", "drawbar_pull"),
        )


def _sinkage(wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    sinkage = windows.get("sinkage", np.zeros(0))
    sinkage = sinkage[np.isfinite(sinkage)]
    if sinkage.size == 0:
        return
    middle = float(np.median(np.abs(sinkage)))
    most = wheel.radius.value if wheel.radius is not None else _MOST_SINKAGE
    if middle > most:
        cause = "it has its zero elsewhere (write tare = 'rest' in [sinkage]), or is no length"
        if middle / 1000.0 < most:
            cause = "it is in mm; write unit = 'mm' in [sinkage]"
        of = "the wheel" if wheel.radius is not None else "any wheel"
        yield Remark(
            "sinkage-out-of-range",
            f"sinkage is {middle:.3g} m, more than the radius of {of}: probably {cause}",
            ("sinkage",),
        )


def _slope(wheel: WheelMap, windows: dict[str, Floats]) -> Iterator[Remark]:
    slope = windows.get("slope", np.zeros(0))
    if slope.size and np.isfinite(slope).any() and float(np.nanmax(np.abs(slope))) > 1.0:
        yield Remark(
            "unit",
            f"the slope goes to {float(np.nanmax(np.abs(slope))):.3g} rad: probably it is in "
            "degrees; write unit = 'deg' in [slope]",
            ("slope",),
        )
