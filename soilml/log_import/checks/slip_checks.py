"""Rows with what is known of their wheel, hints at what looks odd in them, and the checks of slip:

rotation and travel from which none can follow, and slips of another unit or definition.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.inputs import our_slip
from soilml.log_import.channels.wheel_quantities import slip_ratio
from soilml.log_import.mapping.channel_map import (
    ROTATIONS,
    SLIP_DEFINITIONS,
    TRAVELS,
    UNITS,
    ChannelMap,
)
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.units import factor

#: Units that loggers write, by channel: one of them may have been meant by a number.
WRITTEN: dict[str, tuple[str, ...]] = {
    "wheel_speed": ("rad/s", "rpm", "deg/s"), "wheel_angle": ("rad", "deg", "turns"),
    **dict.fromkeys(("rim_speed", "ground_speed"), ("m/s", "cm/s", "mm/s", "km/h")),
    **dict.fromkeys(("position", "sinkage"), ("m", "cm", "mm")),
    **dict.fromkeys(("load", "drawbar_pull"), ("N", "kgf", "kN")),
    "torque": ("N m", "N cm", "mN m", "kgf m", "kN m"), "motor_current": ("A", "mA"),
}  # fmt: skip
LARGEST_RADIUS = 2.0  # A larger one, m, is rather in mm
_OTHER_RADIUS = 0.15  # Largest slip that odometry with another radius gives
_NO_SLIP = 1e-6  # Slip of rows whose travel and rotation are one measurement
#: Travel over rim speed, at the lowest slip and in the middle of the rows, that a wheel may have.
FASTEST, _MIDDLE = (0.55, 1.12), (0.4, 1.2)
#: Share of the rim speed from which a wheel moves, fewest rows, and how near to 1 and how constant
#: travel over rim speed is where one is computed from the other.
_MOVES, _FEWEST, _ODOMETRY, _RESOLUTION = 0.2, 3, 0.03, 1e-3
#: Slips that are alike, and the ratio of the largest to the least effort that one slip seldom has:
#: at a slip of 0.3 loads of 20 to 150 N give 1.2.
_ALIKE, _WORKS = 0.01, 1.4
#: Fewest rows that tell a definition, the least difference of slip that is worth telling, and how
#: many times better than the stated one another must fit.
_FEWEST_ROWS, _LEAST, _BETTER = 4, 0.02, 2.0
_OURS, _RATIO, _OF_TYRES = SLIP_DEFINITIONS
_COMPUTED = "was the travel computed from the rotation of the wheel?"


@dataclass(frozen=True)
class Hint:
    """What looks odd in quantities `about`; `wrong` where the map cannot be right."""

    code: str
    text: str
    about: tuple[str, ...]
    wrong: bool = True


def other_units(role: str, read: str) -> dict[str, float]:
    """Units that a number of a channel may be in instead of `read`, and how much more that is."""
    ours, read = UNITS[role], read or UNITS[role]
    sizes = {unit: factor(unit, ours) / factor(read, ours) for unit in WRITTEN.get(role, ())}
    return {unit: size for unit, size in sizes.items() if abs(size - 1.0) > 1e-3}


@dataclass(frozen=True)
class RowsToCheck:
    """Rows with what is known of their wheel.

    quantities: Columns (rows,) by name: `slip`, `load`, ...; `rim_speed` and `speed` in the
        sensors' own direction.
    radius: Radius of the wheel of all rows or of each (rows,), m; None where it is not known.
    wheel: That of the map; None for a table of runs.
    weight: Least and largest load by the mass of the vehicle, N; None where no mass is known.
    """

    quantities: Mapping[str, Floats]
    radius: Floats | float | None = None
    wheel: WheelMap | None = None
    weight: tuple[float, float] | None = None

    def of(self, name: str) -> Floats:
        """A quantity (rows,); NaN where it is absent."""
        size = next(iter(self.quantities.values())).shape if self.quantities else (0,)
        return np.asarray(self.quantities.get(name, np.full(size, np.nan)), dtype=np.float64)

    def known(self, name: str) -> Floats:
        """The numbers of a quantity; empty where it is absent."""
        return np.asarray(self.of(name)[np.isfinite(self.of(name))])

    def role(self, *roles: str) -> str:
        """The first of these channels that the map has; "" for none, and for a table."""
        channels = self.wheel.channels if self.wheel is not None else {}
        return next((role for role in roles if role in channels), "")

    def channel(self, role: str) -> ChannelMap | None:
        """A channel of the map; None where it has none."""
        return self.wheel.channels.get(role) if self.wheel is not None else None

    def write(self, line: str, role: str) -> str:
        """What to change in the map; nothing for a table."""
        return f"; write {line} in [{role}]" if self.wheel is not None else ""

    def effort(self) -> Floats:
        """Torque over load (rows,), m; NaN where it is not known."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.of("torque") / self.of("load"))

    def units_that_give(
        self, value: float, within: tuple[float, float], **powers: int
    ) -> list[str]:
        """Each mistaken unit whose correction brings a value between two bounds.

        powers: The power with which the value grows with each channel.
        """
        found = []
        for role, power in powers.items():
            channel = self.channel(role)
            if channel is not None and channel.has_scale:
                continue  # a calibration, and no unit
            read = (channel.unit if channel is not None else "") or UNITS[role]
            for meant, size in other_units(role, read).items():
                if within[0] < value * size**power < within[1]:
                    # of a scale, people say kg
                    shown = "kg" if meant == "kgf" else meant
                    what = role.replace("_", " ")
                    found.append(f"the {what} is in {shown} and was read as {read}")
        return found


def check_speeds(rows: RowsToCheck) -> Iterator[Hint]:
    """Rotation and travel, from which slip follows."""
    rotation, travel = rows.role(*ROTATIONS), rows.role(*TRAVELS)
    rim, ground = rows.of("rim_speed"), rows.of("speed")
    good = np.isfinite(rim) & np.isfinite(ground) & (rim != 0.0)
    if not (rotation and travel and good.any()) or rows.role("slip"):
        return
    assert rows.wheel is not None
    ratio, both = ground[good] / rim[good], (travel, rotation)
    if why := _one_sensor(rows, rotation, travel, rim[good], ratio, rows.effort()[good]):
        text = f"{why}; needed is a travel from another sensor, or [slip]"
        yield Hint("one-sensor", text, both)
        return
    if float(np.median(ratio)) < -0.02:
        text = (
            f"travel and rotation have opposite signs in {np.mean(ratio < 0.0):.0%} of "
            f"windows: write reverse = true in [{travel}] or in [{rotation}]"
        )
        yield Hint("sign", text, both)
        ratio = np.abs(ratio)
    middle, fastest = float(np.median(ratio)), float(np.max(ratio))
    radius = rows.wheel.radius.value if rows.wheel.radius else float("nan")
    powers = {travel: 1, rotation: -1}
    if 0.0 < fastest < 0.3:
        excess, unit = f"{1.0 / fastest:.3g}", rows.units_that_give(fastest, FASTEST, **powers)
        cause = (
            f"it was measured before a gearbox of up to {excess} to 1 (write gear_ratio in "
            f"[{rotation}]), or its unit is wrong"
        )
        cause = "the radius is in mm" if radius > LARGEST_RADIUS else ", or ".join(unit) or cause
        text = (
            f"slip is {1.0 - fastest:.4g} or more in all windows: the rim would be {excess} "
            f"times as fast as the travel; probably {cause}"
        )
        yield Hint("rotation-too-fast", text, (rotation,))
    elif middle > 3.0:
        gear = rows.wheel.channels[rotation].gear_ratio.value
        unit = rows.units_that_give(middle, _MIDDLE, **powers)
        cause = f"the unit of [{travel}] or of [{rotation}] is wrong"
        if gear > 1.0 and middle > 0.4 * gear:
            cause = f"[{rotation}] was measured after the gearbox; remove gear_ratio"
        shown = f"travel is {middle:.3g} times as fast as the rim in the middle of the windows"
        yield Hint("travel-too-fast", f"{shown}; probably {', or '.join(unit) or cause}", both)
    elif 0.3 <= fastest < 0.55 and ratio.size > 2 and np.ptp(ratio) > 0.02:
        text = (
            f"slip is {1.0 - fastest:.2g} or more in all windows; was the radius of "
            f"{radius:g} m measured as diameter?"
        )
        yield Hint("radius-as-diameter", text, ("radius",))


def _one_sensor(
    rows: RowsToCheck, rotation: str, travel: str, rim: Floats, ratio: Floats, effort: Floats
) -> str:
    """Why rotation and travel are one measurement, from which no slip follows; "" for two.

    rim, ratio: Rim speed and travel over it (n,). The travel of an odometry of the wheels is r
    omega within its resolution, also where the speed or the `effort` changes.
    """
    assert rows.wheel is not None
    ours, theirs = (rows.wheel.channels[role].columns for role in (rotation, travel))
    if {*ours} & {*theirs}:
        both = f"[{rotation}] and [{travel}] are both of the column {theirs[0]!r}"
        return f"{both}: slip is a constant by construction"
    moves = np.abs(rim) > _MOVES * float(np.max(np.abs(rim), initial=0.0))
    if not ours or not theirs or moves.sum() < _FEWEST:
        return ""
    rim, ratio = np.abs(rim[moves]), ratio[moves]
    middle = float(np.median(ratio))
    changes = float(np.std(rim)) > 10.0 * _RESOLUTION * float(np.median(rim))
    changes |= _slip_without_cause(ratio, effort[moves]) or float(np.ptp(ratio)) == 0.0
    if abs(middle - 1.0) >= _ODOMETRY or float(np.std(ratio)) >= _RESOLUTION or not changes:
        return ""
    return (
        f"the travel is {middle:.4g} times the rim speed in all {int(moves.sum())} windows: "
        f"[{travel}] seems to be computed from the rotation, so that slip is 0 by construction"
    )


def check_definition(rows: RowsToCheck) -> Iterator[Hint]:
    """Whether a slip is per cent, or by another definition."""
    slip, logged = rows.known("slip"), rows.channel("slip")
    if rows.wheel is not None and logged is None:
        return
    if slip.size and float(np.median(np.abs(slip))) >= 1.0:
        shown = f"slip is {float(np.median(slip)):.3g} in the middle of the rows"
        write = rows.write("unit = '%'", "slip")
        yield Hint("slip-unit", f"{shown}: probably it is in per cent{write}", ("slip",))
        return
    rim = rows.of("rim_speed")
    if "rim_speed" not in rows.quantities and rows.radius is not None:
        rim = rows.of("wheel_speed") * rows.radius
    stated = logged.definition if logged else _OURS
    text, definition = "", _definition_by_speeds(rows.of("slip"), rim, rows.of("speed"), stated)
    if definition:
        text = f"slip disagrees with the speeds of rim and travel, and agrees by {definition}"
    elif (above := int(np.sum(slip > 1.0))) > 0:
        definition = _OF_TYRES
        text = (
            f"slip is above 1 in {above} of {slip.size} rows, which {_OURS} cannot be: "
            f"probably the log has {definition}"
        )
    elif _falls_with_slip(rows):
        definition = _RATIO
        text = (
            "torque falls as slip grows: probably slip is the ratio of travel to rim speed, "
            f"{definition}"
        )
    if text:
        text += rows.write(f"definition = '{definition}'", "slip")
        yield Hint("slip-definition", text, ("slip", "torque"))


def _falls_with_slip(rows: RowsToCheck) -> bool:
    """Whether torque for each newton of load falls steadily over a wide range of slip.

    A wheel needs more torque as it slips more, or as much; where it is the other way round,
    slip is the ratio of travel to rim speed.
    """
    slip, lever = rows.of("slip"), rows.effort()
    good = np.isfinite(lever) & (slip > 0.0) & (slip < 1.0)
    slip, lever = slip[good], lever[good]
    if slip.size < 3 or np.ptp(slip) < 0.15 or np.median(lever) <= 0.0:
        return False
    varies = np.ptp(lever) > 0.15 * float(np.median(lever))
    return bool(varies and np.corrcoef(slip, lever)[0, 1] < -0.9)


def check_slips(rows: RowsToCheck) -> Iterator[Hint]:
    """Slips that a unit, the radius or a single sensor for both speeds explains."""
    slip = rows.known("slip")
    if slip.size < 3:
        return
    low, high = float(np.min(slip)), float(np.max(slip))
    largest = max(-low, high)
    by_speeds = rows.wheel is not None and not rows.role("slip")
    alike = by_speeds and _slip_without_cause(1.0 - rows.of("slip"), rows.effort())
    least = f"slip is {low:.2g} or more in all rows"
    oddities = (
        (alike and largest < _OTHER_RADIUS, "one-sensor",
         f"slip is {float(np.median(slip)):.2g} in all rows, however much the wheel works: "
         f"{_COMPUTED}"),
        (0.9 < low < 1.0, "slip-unit",
         f"{least}: probably the rotation was measured before a gearbox, or is in another unit"),
        (0.45 < low < 1.0 and np.ptp(slip) > 0.03, "radius-as-diameter",
         f"{least}: is the radius given as diameter? (slip would begin at {2.0 * low - 1.0:.2g})"),
        (low < -0.3 and high < 0.0, "slip-negative",
         f"slip is below zero in all rows, {low:.2g} at least: are rim and travel speed "
         "exchanged, or is the radius too small?"),
        (largest < _NO_SLIP, "one-sensor", f"slip is 0 in all rows: {_COMPUTED}"),
        (largest < 0.01 and not by_speeds, "slip-unit",
         "slip is below 0.01 in all rows: was it divided by 100 twice?"),
    )  # fmt: skip
    for applies, code, text in oddities:
        if applies:
            travel = rows.role(*TRAVELS) if alike and code == "one-sensor" else ""
            yield Hint(code, text, tuple(filter(None, (travel, "slip"))), wrong=False)
            return


def _slip_without_cause(ratio: Floats, effort: Floats) -> bool:
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


def _definition_by_speeds(slip: Floats, rim: Floats, travel: Floats, stated: str) -> str:
    """The definition by which slip agrees with the speeds; "" for the stated one.

    slip: As 1 - v/(r omega), (rows,), where it was defined as `stated`.
    rim, travel: Speeds (rows,), m/s, in the sensors' own direction; NaN where not known.

    The distance of a definition from the speeds is the median over the rows of the difference of
    slip. It replaces the stated one where that is `_LEAST` or more off, and `_BETTER` times as far.
    """
    direction = np.where(rim < 0.0, -1.0, 1.0)
    by_speeds = slip_ratio(direction * rim, direction * travel)
    good = np.isfinite(slip) & np.isfinite(by_speeds) & (np.abs(by_speeds) < 1.0)
    if good.sum() < _FEWEST_ROWS:
        return ""
    slip, by_speeds = slip[good], by_speeds[good]
    with np.errstate(divide="ignore", invalid="ignore"):
        given = {
            _OURS: slip,
            _RATIO: np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip)),
            _OF_TYRES: np.where(slip > 0.0, slip / (1.0 - slip), slip),
        }[stated]
    distance = {
        name: float(np.median(np.abs(our_slip(given, name) - by_speeds)))
        for name in SLIP_DEFINITIONS
    }
    best, off = min(distance, key=lambda name: distance[name]), distance[stated]
    return best if off > _LEAST and off > _BETTER * distance[best] else ""
