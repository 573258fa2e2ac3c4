"""Rows that look as if a unit, a sign, a column or the radius were wrong, with the likely cause.

Rows are those of a table of runs, or the windows of a log with its map. What an import refuses is a
hint with `wrong`; other hints are remarks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.checks.slip_definition import definition_by_speeds
from soilml.log_import.checks.speed_hints import rate_hints, slip_without_cause
from soilml.log_import.mapping.log_map import Vehicle, WheelMap
from soilml.log_import.units import spelling

#: Range of T / (W r) of driving wheels on soil, and its usual value.
_LEAST_TRACTION, _MOST_TRACTION, _USUAL_TRACTION = 0.02, 1.2, 0.3
#: Largest pull over load, lever arm of torque over load, m, and sinkage, m, of any wheel.
_MOST_PULL, _MOST_LEVER, _MOST_SINKAGE = 1.2, 0.8, 0.7
_USUAL_SINKAGE = (0.02, 0.7)  # Range of the usual sinkage over the radius
_SLIPS = 0.05  # Slip from which a driving wheel has a torque worth judging
_OTHER_RADIUS = 0.15  # Largest slip that odometry with another radius gives
_NO_SLIP = 1e-6  # Slip of rows whose travel and rotation are one measurement
_LEAST_LOAD = 1.0  # Load, N, below which no wheel is driven: it is then rather in kN
FAR_FROM_WEIGHT = 2.5  # Factor between a load and its share of the mass that no slope explains
_BY_UNIT = 4.0  # How far from the usual T / (W r) another unit may bring it, as a factor
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


@dataclass(frozen=True)
class RowsToCheck:
    """Rows with what is known of their wheel.

    rows: Quantities (rows,) by name: `slip`, `load`, `torque`, ...; `rim_speed` and `speed` in the
        sensors' own direction.
    radius: Radius of the wheel of all rows or of each (rows,), m; None where it is not known.
    wheel, vehicle: Those of the map; None for a table of runs.
    """

    rows: Mapping[str, Floats]
    radius: Floats | float | None = None
    wheel: WheelMap | None = None
    vehicle: Vehicle | None = None

    def hints(self) -> list[Hint]:
        """Hints at what is wrong: causes come before consequences."""
        checks = (self._angles, self._rates, self._slip, self._load, self._torque, self._pull,
                  self._sinkage)  # fmt: skip
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

    def _angles(self) -> Iterator[Hint]:
        for name in ("slope", "slip_angle"):
            largest = float(np.max(np.abs(self._known(name)), initial=0.0))
            if largest > (1.0 if self.wheel is not None else 1.571):
                shown = f"the {name.replace('_', ' ')} goes to {largest:.3g} rad"
                write = self._write("unit = 'deg'", name)
                yield Hint("unit", f"{shown}: probably it is in degrees{write}", (name,))

    def _rates(self) -> Iterator[Hint]:
        """Rotation and travel, from which slip follows."""
        if self.wheel is not None and {"rim_speed", "speed"} <= self.rows.keys():
            rim, speed = self.rows["rim_speed"], self.rows["speed"]
            for code, text, about in rate_hints(self.wheel, rim, speed, self._effort()):
                yield Hint(code, text, about)

    def _slip(self) -> Iterator[Hint]:
        slip = self._known("slip")
        logged = bool(self._channel("slip"))
        if self.wheel is None or logged:
            yield from self._definition(slip, logged)
        if slip.size < 3:
            return
        low, high = float(np.min(slip)), float(np.max(slip))
        largest = max(-low, high)
        by_speeds = self.wheel is not None and not logged
        alike = by_speeds and slip_without_cause(1.0 - self._of("slip"), self._effort())
        code, about, text = "slip-unit", ["slip"], ""
        if alike and largest < _OTHER_RADIUS:  # more is a slip that was set
            middle = f"{float(np.median(slip)):.2g}"
            text = f"slip is {middle} in all rows, however much the wheel works: {_COMPUTED}"
            code, about = "one-sensor", ["speed", "slip"]
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

    def _definition(self, slip: Floats, logged: bool) -> Iterator[Hint]:
        """Whether a slip is per cent, or by another definition."""
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
        elif self.vehicle is not None and "load" in self.wheel.channels:
            weight = self.vehicle.mass.value * self.vehicle.gravity / self.vehicle.wheels
            if 0.7 < weight / middle / 9.80665 < 1.4:
                text = f"the load of {middle:.3g} N is a tenth of the weight: probably it is in kg"
                yield Hint("unit", text + self._write("unit = 'kgf'", "load"), ("load",))
            elif not 1.0 / FAR_FROM_WEIGHT < middle / weight < FAR_FROM_WEIGHT:
                text = (
                    f"{shown}, and the mass of [vehicle] gives {weight:.3g} N for each wheel: "
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
        if judged.any() and (self.radius is not None or self.wheel is not None):
            lever = np.abs(torque[judged]) / load[judged]
            middle = float(np.median(lever))
            if self.radius is not None:
                traction = lever / np.broadcast_to(self.radius, torque.shape)[judged]
                middle = float(np.median(traction))
                if cause := self._traction_cause(middle, float(np.median(load[judged]))):
                    shown = f"torque is {middle:.3g} times W r in the middle of the rows"
                    yield Hint("traction-out-of-range", f"{shown}: probably {cause}", about)
                elif self.wheel is None and (np.max(traction) > 2 * _MOST_TRACTION):
                    row = int(np.flatnonzero(judged)[np.argmax(traction)]) + 1
                    shown = f"torque is {float(np.max(traction)):.3g} times W r in row {row}"
                    yield Hint("odd-row", f"{shown}: look at that row", about[:1], wrong=False)
            elif middle > _MOST_LEVER:
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
        if _LEAST_TRACTION <= traction <= _MOST_TRACTION:
            return ""
        role = self._channel("torque", "motor_current")
        channel = self.wheel.channels[role] if self.wheel and role else None
        ratio = channel.gear_ratio.value if channel else 1.0
        if channel and ratio > 1.0 and _LEAST_TRACTION < traction / ratio < _MOST_TRACTION:
            return f"[{role}] is at the wheel already; remove gear_ratio"
        factors = [(1.0 / 9.80665, "the load is in kg and was read as N")]
        if role == "motor_current":
            factors += [(1e-3, "torque_constant is in mN m/A, or the current in mA")]
        elif channel and spelling(channel.unit) == "mN*m":
            factors += [(1e3, f"[torque] is in N m, and was read as {channel.unit}")]
        else:
            factors += [(1e3, "the torque is in kN m, or the radius in mm"),
                        (9.80665, "the torque is in kgf m"),
                        (1e-2, "the torque is in N cm and was read as N m"),
                        (1e-3, "the load is in kN and was read as N") if load < _LEAST_LOAD else
                        (1e-3, "the torque is in mN m and was read as N m")]  # fmt: skip
        distance, cause = min((abs(np.log(max(traction * factor, 1e-30) / _USUAL_TRACTION)), text)
                              for factor, text in factors)  # fmt: skip
        if distance < np.log(_BY_UNIT):
            return cause
        if role == "motor_current":
            return "gear_ratio or the unit of torque_constant is wrong, or the sensor is dead"
        if traction > _MOST_TRACTION:
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
            units = [u for u, factor in (("cm", 100.0), ("mm", 1000.0))
                     if _USUAL_SINKAGE[0] < middle / factor / most < _USUAL_SINKAGE[1]]  # fmt: skip
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
