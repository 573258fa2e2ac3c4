"""Rows that look as if a unit, a sign, a column or the radius were wrong, with the likely cause.

Rows are those of a table of runs, the windows of a log with its map, or seconds of driving of a map
that is guessed. What an import refuses is a hint with `wrong`; other hints are remarks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.checks.slip_definition import definition_by_speeds
from soilml.log_import.mapping.channel_map import ROTATIONS, TRAVELS, UNITS
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
TRACTION = (0.02, 1.2)  # Range of T / (W r) of driving wheels on soil
_USUAL_TRACTION = 0.3
#: Largest pull over load, lever arm of torque over load, m, and sinkage, m, of any wheel.
_MOST_PULL, _MOST_LEVER, _MOST_SINKAGE = 1.2, 0.8, 0.7
_USUAL_SINKAGE = (0.02, 0.7)  # Range of the usual sinkage over the radius
_SLIPS = 0.05  # Slip from which a driving wheel has a torque worth judging
_OTHER_RADIUS = 0.15  # Largest slip that odometry with another radius gives
_NO_SLIP = 1e-6  # Slip of rows whose travel and rotation are one measurement
_LEAST_LOAD = 1.0  # Load, N, below which no wheel is driven: it is then rather in kN
_FAR_FROM_WEIGHT = 2.5  # Factor between a load and its share of the mass that no slope explains
_BY_UNIT = 4.0  # How far from the usual T / (W r) another unit may bring it, as a factor
#: Travel over rim speed, at the lowest slip and in the middle of the rows, that a wheel may have.
FASTEST, _MIDDLE = (0.55, 1.12), (0.4, 1.2)
#: Share of the rim speed from which a wheel moves, fewest rows, and how near to 1 and how constant
#: travel over rim speed is where one is computed from the other.
_MOVES, _FEWEST, _ODOMETRY, _RESOLUTION = 0.2, 3, 0.03, 1e-3
#: Slips that are alike, and the ratio of the largest to the least effort that one slip seldom has:
#: at a slip of 0.3 loads of 20 to 150 N give 1.2.
_ALIKE, _WORKS = 0.01, 1.4
_OURS = "1 - v/(r omega)"
_TURNED = "probably its sign is turned"
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

    rows: Quantities (rows,) by name: `slip`, `load`, `torque`, ...; `rim_speed` and `speed` in the
        sensors' own direction.
    radius: Radius of the wheel of all rows or of each (rows,), m; None where it is not known.
    wheel: That of the map; None for a table of runs.
    weight: Least and largest load by the mass of the vehicle, N; None where no mass is known.
    """

    rows: Mapping[str, Floats]
    radius: Floats | float | None = None
    wheel: WheelMap | None = None
    weight: tuple[float, float] | None = None

    def hints(self) -> list[Hint]:
        """Hints at what is wrong: causes come before consequences."""
        checks = (self._angles, self._rates, self._definition, self._slip, self._load,
                  self._torque, self._pull, self._sinkage)  # fmt: skip
        return [hint for check in checks for hint in check()]

    def _of(self, name: str) -> Floats:
        """A quantity (rows,); NaN where it is absent."""
        size = next(iter(self.rows.values())).shape if self.rows else (0,)
        return np.asarray(self.rows.get(name, np.full(size, np.nan)), dtype=np.float64)

    def _known(self, name: str) -> Floats:
        """The numbers of a quantity; empty where it is absent."""
        return np.asarray(self._of(name)[np.isfinite(self._of(name))])

    def _channel(self, *roles: str) -> str:
        """The first of these channels that the map has; "" for none, and for a table."""
        channels = self.wheel.channels if self.wheel is not None else {}
        return next((role for role in roles if role in channels), "")

    def _write(self, line: str, role: str) -> str:
        """What to change in the map; nothing for a table."""
        return f"; write {line} in [{role}]" if self.wheel is not None else ""

    def _effort(self) -> Floats:
        """Torque over load (rows,), m; NaN where it is not known."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self._of("torque") / self._of("load"))

    def _read_as(self, role: str) -> tuple[str, dict[str, float]]:
        """The unit in which a channel is read, and those that may be meant instead."""
        channel = self.wheel.channels.get(role) if self.wheel is not None else None
        if channel is not None and channel.has_scale:
            return "", {}
        read = (channel.unit if channel is not None else "") or UNITS[role]
        return read, other_units(role, read)

    def _angles(self) -> Iterator[Hint]:
        for name in ("slope", "slip_angle"):
            largest = float(np.max(np.abs(self._known(name)), initial=0.0))
            if largest > (1.0 if self.wheel is not None else 1.571):
                shown = f"the {name.replace('_', ' ')} goes to {largest:.3g} rad"
                write = self._write("unit = 'deg'", name)
                yield Hint("unit", f"{shown}: probably it is in degrees{write}", (name,))

    def _rates(self) -> Iterator[Hint]:
        """Rotation and travel, from which slip follows."""
        rotation, travel = self._channel(*ROTATIONS), self._channel(*TRAVELS)
        rim, ground = self._of("rim_speed"), self._of("speed")
        good = np.isfinite(rim) & np.isfinite(ground) & (rim != 0.0)
        if not (rotation and travel and good.any()) or self._channel("slip"):
            return
        assert self.wheel is not None
        ratio, both = ground[good] / rim[good], (travel, rotation)
        if why := self._one_sensor(rotation, travel, rim[good], ratio, self._effort()[good]):
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
        radius = self.wheel.radius.value if self.wheel.radius else float("nan")
        if 0.0 < fastest < 0.3:
            excess = f"{1.0 / fastest:.3g}"
            cause = self._other_speeds(both, fastest, FASTEST) or (
                f"probably it was measured before a gearbox of up to {excess} to 1 (write "
                f"gear_ratio in [{rotation}]), or its unit is wrong"
            )
            cause = "probably the radius is in mm" if radius > 2.0 else cause
            text = (
                f"slip is {1.0 - fastest:.4g} or more in all windows: the rim would be {excess} "
                f"times as fast as the travel; {cause}"
            )
            yield Hint("rotation-too-fast", text, (rotation,))
        elif middle > 3.0:
            gear = self.wheel.channels[rotation].gear_ratio.value
            cause = self._other_speeds(both, middle, _MIDDLE)
            if not cause and gear > 1.0 and middle > 0.4 * gear:
                cause = f"probably [{rotation}] was measured after the gearbox; remove gear_ratio"
            cause = cause or f"probably the unit of [{travel}] or of [{rotation}] is wrong"
            shown = f"travel is {middle:.3g} times as fast as the rim in the middle of the windows"
            yield Hint("travel-too-fast", f"{shown}; {cause}", both)
        elif 0.3 <= fastest < 0.55 and ratio.size > 2 and np.ptp(ratio) > 0.02:
            text = (
                f"slip is {1.0 - fastest:.2g} or more in all windows; was the radius of "
                f"{radius:g} m measured as diameter?"
            )
            yield Hint("radius-as-diameter", text, ("radius",))

    def _one_sensor(
        self, rotation: str, travel: str, rim: Floats, ratio: Floats, effort: Floats
    ) -> str:
        """Why rotation and travel are one measurement, from which no slip follows; "" for two.

        rim, ratio: Rim speed and travel over it (n,). The travel of an odometry of the wheels is r
        omega within its resolution, also where the speed or the `effort` changes.
        """
        assert self.wheel is not None
        ours, theirs = (self.wheel.channels[role].columns for role in (rotation, travel))
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

    def _other_speeds(
        self, roles: tuple[str, str], ratio: float, plausible: tuple[float, float]
    ) -> str:
        """The units by which travel over rim speed would be that of a wheel; "" for none.

        roles: Travel and rotation. ratio: With the units that the map has.
        """
        found = []
        for role, power in zip(reversed(roles), (-1, 1), strict=True):
            read, others = self._read_as(role)
            found += [f"[{role}] is in {meant}, and was read as {read}"
                      for meant, size in others.items()
                      if plausible[0] < ratio * size**power < plausible[1]]  # fmt: skip
        return f"probably {', or '.join(found)}" if found else ""

    def _slip(self) -> Iterator[Hint]:
        slip = self._known("slip")
        if slip.size < 3:
            return
        low, high = float(np.min(slip)), float(np.max(slip))
        largest = max(-low, high)
        by_speeds = self.wheel is not None and not self._channel("slip")
        alike = by_speeds and _slip_without_cause(1.0 - self._of("slip"), self._effort())
        code, about, text = "slip-unit", ["slip"], ""
        if alike and largest < _OTHER_RADIUS:  # more is a slip that was set
            middle = f"{float(np.median(slip)):.2g}"
            text = f"slip is {middle} in all rows, however much the wheel works: {_COMPUTED}"
            code, about = "one-sensor", [self._channel(*TRAVELS), "slip"]
        elif 0.9 < low < 1.0:
            text = (
                f"slip is {low:.2g} or more in all rows: probably the rotation was measured before "
                "a gearbox, or is in another unit"
            )
        elif 0.45 < low < 1.0 and np.ptp(slip) > 0.03:
            text = (
                f"slip is {low:.2g} or more in all rows: is the radius given as diameter? (slip "
                f"would begin at {2.0 * low - 1.0:.2g})"
            )
            code = "radius-as-diameter"
        elif low < -0.3 and high < 0.0:
            text = (
                f"slip is below zero in all rows, {low:.2g} at least: are rim and travel speed "
                "exchanged, or is the radius too small?"
            )
            code = "slip-negative"
        elif largest < _NO_SLIP:
            code, text = "one-sensor", f"slip is 0 in all rows: {_COMPUTED}"
        elif largest < 0.01 and not by_speeds:
            text = "slip is below 0.01 in all rows: was it divided by 100 twice?"
        if text:
            yield Hint(code, text, tuple(about), wrong=False)

    def _definition(self) -> Iterator[Hint]:
        """Whether a slip is per cent, or by another definition."""
        slip, logged = self._known("slip"), bool(self._channel("slip"))
        if self.wheel is not None and not logged:
            return
        if slip.size and float(np.median(np.abs(slip))) >= 1.0:
            shown = f"slip is {float(np.median(slip)):.3g} in the middle of the rows"
            write = self._write("unit = '%'", "slip")
            yield Hint("slip-unit", f"{shown}: probably it is in per cent{write}", ("slip",))
            return
        rim = self.rows.get("rim_speed")
        if rim is None and "wheel_speed" in self.rows and self.radius is not None:
            rim = self.rows["wheel_speed"] * self.radius
        found, text = None, ""
        if rim is not None and {"slip", "speed"} <= self.rows.keys():
            stated = self.wheel.channels["slip"].definition if logged and self.wheel else _OURS
            found = definition_by_speeds(self.rows["slip"], rim, self.rows["speed"], stated)
        if found is not None:
            definition, unit = found
            lines = [f"definition = '{definition}'", *([f"unit = '{unit}'"] if unit else [])]
            text = (
                "slip disagrees with the speeds of rim and travel, and agrees by another "
                f"definition: {definition}{' in per cent' if unit else ''}"
                f"{self._write(' and '.join(lines), 'slip')}"
            )
        elif (above := int(np.sum(slip > 1.0))) > 0:
            text = (
                f"slip is above 1 in {above} of {slip.size} rows, which {_OURS} cannot be: "
                "probably the log has (r omega - v)/v"
            ) + self._write("definition = '(r omega - v)/v'", "slip")
        elif self._falls_with_slip():
            text = (
                "torque falls as slip grows: probably slip is the ratio of travel to rim speed, "
                "v/(r omega)"
            ) + self._write("definition = 'v/(r omega)'", "slip")
        if text:
            yield Hint("slip-definition", text, ("slip", "torque"))

    def _falls_with_slip(self) -> bool:
        """Whether torque for each newton of load falls steadily over a wide range of slip.

        A wheel needs more torque as it slips more, or as much; where it is the other way round,
        slip is the ratio of travel to rim speed.
        """
        slip, lever = self._of("slip"), self._effort()
        good = np.isfinite(lever) & (slip > 0.0) & (slip < 1.0)
        slip, lever = slip[good], lever[good]
        if slip.size < 3 or np.ptp(slip) < 0.15 or np.median(lever) <= 0.0:
            return False
        varies = np.ptp(lever) > 0.15 * float(np.median(lever))
        return bool(varies and np.corrcoef(slip, lever)[0, 1] < -0.9)

    def _load(self) -> Iterator[Hint]:
        load = self._known("load")
        if self.wheel is None or load.size == 0:
            return
        middle = float(np.median(load))
        shown = f"the load is {middle:.3g} N in the middle of the rows"
        if middle <= 0.0:
            write = self._write("reverse = true", "load")
            yield Hint("sign", f"{shown}: {_TURNED}{write}", ("load",))
        elif self.weight is not None and self._channel("load"):
            least, most = self.weight
            if 0.7 < most / middle / 9.80665 < 1.4:
                text = f"the load of {middle:.3g} N is a tenth of the weight: probably it is in kg"
                yield Hint("unit", text + self._write("unit = 'kgf'", "load"), ("load",))
            elif not least / _FAR_FROM_WEIGHT < middle < _FAR_FROM_WEIGHT * most:
                text = (
                    f"{shown}, and the mass of [vehicle] gives {most:.3g} N for each wheel: "
                    "probably one of them is wrong, or the column is another force"
                )
                yield Hint("load-not-of-mass", text, ("load",))

    def _torque(self) -> Iterator[Hint]:
        torque, slip, load = (self._of(name) for name in ("torque", "slip", "load"))
        about = (self._channel("torque", "motor_current") or "torque", "load")
        driving = np.isfinite(torque) & (slip > _SLIPS)
        judged = driving & (load > 0.0)
        if self.wheel is not None and not judged.any():
            judged = np.isfinite(torque) & (load > 0.0)
        if judged.any() and self.radius is not None:
            lever = np.abs(torque[judged]) / load[judged]
            traction = lever / np.broadcast_to(self.radius, torque.shape)[judged]
            middle, largest = float(np.median(traction)), float(np.max(traction))
            if cause := self._traction_cause(middle, float(np.median(load[judged]))):
                shown = f"torque is {middle:.3g} times W r in the middle of the rows"
                yield Hint("traction-out-of-range", f"{shown}: probably {cause}", about)
            elif self.wheel is None and largest > 2 * TRACTION[1]:
                row = int(np.flatnonzero(judged)[np.argmax(traction)]) + 1
                shown = f"torque is {largest:.3g} times W r in row {row}"
                yield Hint("odd-row", f"{shown}: look at that row", about[:1], wrong=False)
        elif judged.any() and self.wheel is not None:
            middle = float(np.median(np.abs(torque[judged]) / load[judged]))
            if middle > _MOST_LEVER:
                text = (
                    f"torque over load is {middle:.3g} m in the middle of the rows, more than the "
                    "radius of a wheel: probably the unit of one of them is wrong, or a column is "
                    "another moment or force"
                )
                yield Hint("traction-out-of-range", text, about)
        turned = torque[driving & (torque != 0.0)]
        if turned.size >= 2 and np.mean(turned < 0.0) > 0.6:
            shown = f"torque is below zero in {int(np.sum(turned < 0.0))} of {turned.size}"
            write = self._write("reverse = true", about[0])
            yield Hint("sign", f"{shown} driving rows: {_TURNED}{write}", about[:1])
        known = np.isfinite(torque) & np.isfinite(slip)
        if known.sum() >= 4 and np.ptp(slip[known]) > 0.05 and np.ptp(torque[known]) == 0.0:
            text = f"torque is {float(torque[known][0]):g} N m at every slip: probably its sensor "
            yield Hint("constant-reading", f"{text}is dead", about[:1], wrong=False)

    def _traction_cause(self, traction: float, load: float) -> str:
        """The likely cause of T / (W r) outside of its range; "" where it is inside.

        Of several mistakes, that whose correction comes nearest to a usual wheel.
        traction, load: In the middle of the rows; load in N.
        """
        low, high = TRACTION
        if low <= traction <= high:
            return ""
        role = self._channel("torque", "motor_current") or "torque"
        channel = self.wheel.channels.get(role) if self.wheel is not None else None
        ratio = channel.gear_ratio.value if channel else 1.0
        if channel and ratio > 1.0 and low < traction / ratio < high:
            return f"[{role}] is at the wheel already; remove gear_ratio"
        factors = {"the load is in kg and was read as N": 1.0 / 9.80665}
        if role == "motor_current":
            factors["torque_constant is in mN m/A, or the current in mA"] = 1e-3
        else:
            read, others = self._read_as(role)
            for meant, size in others.items():
                beside = ", or the radius in mm" if meant == "kN m" else ""
                factors[f"the torque is in {meant} and was read as {read}{beside}"] = size
            if load < _LEAST_LOAD:
                factors = {"the load is in kN and was read as N": 1e-3} | factors
        off = {text: abs(np.log(max(traction * size, 1e-30) / _USUAL_TRACTION))
               for text, size in factors.items()}  # fmt: skip
        cause = min(off, key=lambda text: off[text])
        if off[cause] < np.log(_BY_UNIT):
            return cause
        if role == "motor_current":
            return "gear_ratio or the unit of torque_constant is wrong, or the sensor is dead"
        if traction > high:
            return "the torque is wrong by a gear ratio, or the radius by its unit"
        return "the torque lacks a gear ratio, or its sensor is dead"

    def _pull(self) -> Iterator[Hint]:
        pull, load = self._of("drawbar_pull"), self._of("load")
        known = np.isfinite(pull) & (load > 0.0)
        if not known.any():
            return
        ratio, slip = pull[known] / load[known], self._of("slip")[known]
        middle = float(np.median(np.abs(ratio)))
        if middle > _MOST_PULL:
            text = (
                f"drawbar pull is {middle:.3g} times the load in the middle of the rows, more than "
                "soil can give: probably one of them is in another unit, was not tared, or is "
                "another force"
            )
            yield Hint("pull-out-of-range", text, ("load", "drawbar_pull"))
        if slip.size >= 4 and np.isfinite(slip).all() and np.ptp(slip) > 0.2:
            # a wheel that sinks with slip may lose pull from small slip on, but seldom all of it
            order = np.corrcoef(slip, ratio)[0, 1] if np.ptp(ratio) > 0.05 else 0.0
            late = float(np.mean(ratio[slip >= np.median(slip)]))
            if order < -0.8 and late < 0.0 and float(np.min(slip)) < 0.25:
                text = f"drawbar pull falls below zero as slip grows: {_TURNED}"
                yield Hint("sign", text, ("drawbar_pull",), wrong=False)

    def _sinkage(self) -> Iterator[Hint]:
        sinkage = self._known("sinkage")
        if sinkage.size == 0 or (self.wheel is None and self.radius is None):
            return
        middle = float(np.median(np.abs(sinkage)))
        most = _MOST_SINKAGE if self.radius is None else float(np.nanmedian(self.radius))
        if middle > most:
            units = [unit for unit, size in self._read_as("sinkage")[1].items()
                     if _USUAL_SINKAGE[0] < middle * size / most < _USUAL_SINKAGE[1]]  # fmt: skip
            cause = f"it is in {' or '.join(units) or 'another unit'}"
            if self.wheel is not None and middle / 1000.0 < most:
                cause = "it is in mm; write unit = 'mm' in [sinkage]"
            elif self.wheel is not None:
                cause = (
                    "it has its zero elsewhere (write tare = 'rest' in [sinkage]), or is no length"
                )
            of = "the wheel" if self.radius is not None else "any wheel"
            text = f"sinkage is {middle:.3g} m, more than the radius of {of}: probably {cause}"
            yield Hint("sinkage-out-of-range", text, ("sinkage",))
        elif float(np.median(sinkage)) < -0.002:
            shown = f"sinkage is {float(np.median(sinkage)):.3g} m in the middle of the rows"
            yield Hint("sign", f"{shown}: {_TURNED}", ("sinkage",), wrong=False)


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
