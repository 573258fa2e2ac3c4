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
LEAST_TRACTION, MOST_TRACTION, USUAL_TRACTION = 0.02, 1.2, 0.3
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

    def _known(self, name: str) -> Floats:
        """The numbers of a quantity; empty where it is absent."""
        values = self.rows.get(name, np.zeros(0))
        return np.asarray(values[np.isfinite(values)])

    def _channel(self, *roles: str) -> str:
        """The first of these channels that the map has; "" for none, and for a table."""
        channels = self.wheel.channels if self.wheel is not None else {}
        return next((role for role in roles if role in channels), "")

    def _unit(self, role: str) -> str:
        return self.wheel.channels[role].unit if self.wheel is not None else ""

    def _write(self, line: str, role: str) -> str:
        """What to change in the map; nothing for a table."""
        return f"; write {line} in [{role}]" if self.wheel is not None else ""

    def _effort(self) -> Floats:
        """Torque over load (rows,), m; NaN where it is not known."""
        slip = self.rows["slip"]
        torque, load = (self.rows.get(n, np.full(slip.shape, np.nan)) for n in ("torque", "load"))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(torque / load)

    def _angles(self) -> Iterator[Hint]:
        for name in ("slope", "slip_angle"):
            largest = float(np.max(np.abs(self._known(name)), initial=0.0))
            if largest > (1.0 if self.wheel is not None else 1.571):
                text = f"the {name.replace('_', ' ')} goes to {largest:.3g} rad: probably it is in "
                text += "degrees"
                yield Hint("unit", text + self._write("unit = 'deg'", name), (name,))

    def _rates(self) -> Iterator[Hint]:
        """Rotation and travel, from which slip follows."""
        if self.wheel is not None and {"rim_speed", "speed"} <= self.rows.keys():
            for code, text, about in rate_hints(
                self.wheel, self.rows["rim_speed"], self.rows["speed"], self._effort()
            ):
                yield Hint(code, text, about)

    def _slip(self) -> Iterator[Hint]:
        slip = self._known("slip")
        logged = bool(self._channel("slip"))
        if self.wheel is None or logged:
            yield from self._definition(slip, logged)
        if slip.size < 3:
            return
        lowest, largest = float(np.min(slip)), float(np.max(np.abs(slip)))
        by_speeds = self.wheel is not None and not logged
        alike = by_speeds and slip_without_cause(1.0 - self.rows["slip"], self._effort())
        if alike and largest < _OTHER_RADIUS:  # more is a slip that was set
            text = (
                f"slip is {float(np.median(slip)):.2g} in all rows, however much the wheel works: "
                "was the travel computed from the rotation of the wheel?"
            )
            yield Hint("one-sensor", text, ("speed", "slip"), wrong=False)
        elif 0.9 < lowest < 1.0:
            text = (
                f"slip is {lowest:.2g} or more in all rows: probably the rotation was measured "
                "before a gearbox, or is in another unit"
            )
            yield Hint("slip-unit", text, ("slip",), wrong=False)
        elif 0.45 < lowest < 1.0 and np.ptp(slip) > 0.03:
            text = (
                f"slip is {lowest:.2g} or more in all rows: is the radius given as diameter? (slip "
                f"would begin at {2.0 * lowest - 1.0:.2g})"
            )
            yield Hint("radius-as-diameter", text, ("slip",), wrong=False)
        elif lowest < -0.3 and float(np.max(slip)) < 0.0:
            text = (
                f"slip is below zero in all rows, {lowest:.2g} at least: are rim and travel speed "
                "exchanged, or is the radius too small?"
            )
            yield Hint("slip-negative", text, ("slip",), wrong=False)
        elif largest < _NO_SLIP:
            text = "slip is 0 in all rows: was the travel computed from the rotation of the wheel?"
            yield Hint("one-sensor", text, ("slip",), wrong=False)
        elif largest < 0.01 and not by_speeds:
            text = "slip is below 0.01 in all rows: was it divided by 100 twice?"
            yield Hint("slip-unit", text, ("slip",), wrong=False)

    def _definition(self, slip: Floats, logged: bool) -> Iterator[Hint]:
        """Whether a slip is per cent, or by another definition."""
        if slip.size and float(np.median(np.abs(slip))) >= 1.0:
            text = (
                f"slip is {float(np.median(slip)):.3g} in the middle of the rows: probably it is "
                f"in per cent"
            )
            yield Hint("slip-unit", text + self._write("unit = '%'", "slip"), ("slip",))
            return
        rim = self.rows.get("rim_speed")
        if rim is None and "wheel_speed" in self.rows and self.radius is not None:
            rim = self.rows["wheel_speed"] * self.radius
        found = None
        if rim is not None and {"slip", "speed"} <= self.rows.keys():
            stated = self.wheel.channels["slip"].definition if logged and self.wheel else _OURS
            found = definition_by_speeds(self.rows["slip"], rim, self.rows["speed"], stated)
        text = ""
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
        elif falls_with_slip(self.rows):
            text = (
                "torque falls as slip grows: probably slip is the ratio of travel to rim speed, "
                "v/(r omega)"
            ) + self._write("definition = 'v/(r omega)'", "slip")
        if text:
            yield Hint("slip-definition", text, ("slip", "torque"))

    def _load(self) -> Iterator[Hint]:
        load = self._known("load")
        if self.wheel is None or load.size == 0:
            return
        middle = float(np.median(load))
        if middle <= 0.0:
            text = (
                f"the load is {middle:.3g} N in the middle of the rows: probably its sign is turned"
            )
            yield Hint("sign", text + self._write("reverse = true", "load"), ("load",))
        elif self.vehicle is not None and "load" in self.wheel.channels:
            weight = self.vehicle.mass.value * self.vehicle.gravity / self.vehicle.wheels
            if 0.7 < weight / middle / 9.80665 < 1.4:
                text = f"the load of {middle:.3g} N is a tenth of the weight: probably it is in kg"
                yield Hint("unit", text + self._write("unit = 'kgf'", "load"), ("load",))
            elif not 1.0 / FAR_FROM_WEIGHT < middle / weight < FAR_FROM_WEIGHT:
                text = (
                    f"the load is {middle:.3g} N in the middle of the rows, and the mass of "
                    f"[vehicle] gives {weight:.3g} N for each wheel: probably one of them is "
                    "wrong, or the column is another force"
                )
                yield Hint("load-not-of-mass", text, ("load",))

    def _torque(self) -> Iterator[Hint]:
        if "torque" not in self.rows:
            return
        torque = self.rows["torque"]
        slip = self.rows.get("slip", np.full(torque.shape, np.nan))
        load = self.rows.get("load", np.full(torque.shape, np.nan))
        about = (self._channel("torque", "motor_current") or "torque", "load")
        driving = np.isfinite(torque) & (slip > _SLIPS)
        judged = driving & (load > 0.0)
        if self.wheel is not None and not judged.any():
            judged = np.isfinite(torque) & (load > 0.0)
        if judged.any() and self.radius is not None:
            radius = np.broadcast_to(self.radius, torque.shape)[judged]
            traction = np.abs(torque[judged]) / load[judged] / radius
            middle = float(np.median(traction))
            if cause := self._traction_cause(middle, float(np.median(load[judged]))):
                text = (
                    f"torque is {middle:.3g} times W r in the middle of the rows: probably {cause}"
                )
                yield Hint("traction-out-of-range", text, about)
            elif self.wheel is None and (odd := np.flatnonzero(traction > 2 * MOST_TRACTION)).size:
                row = int(np.flatnonzero(judged)[odd[0]]) + 1
                text = (
                    f"torque is {float(traction[odd[0]]):.3g} times W r in row {row}, and at most "
                    f"{float(np.sort(traction)[-odd.size - 1]):.2g} times in the others: look at "
                    "that row"
                )
                yield Hint("odd-row", text, about[:1], wrong=False)
        elif judged.any() and self.wheel is not None:
            lever = float(np.median(np.abs(torque[judged]) / load[judged]))
            if lever > _MOST_LEVER:
                text = (
                    f"torque over load is {lever:.3g} m in the middle of the rows, more than the "
                    "radius of a wheel: probably the unit of one of them is wrong, or a column is "
                    "another moment or force"
                )
                yield Hint("traction-out-of-range", text, about)
        turned = driving & (torque != 0.0)
        if turned.sum() >= 2 and np.mean(torque[turned] < 0.0) > 0.6:
            text = (
                f"torque is below zero in {int(np.sum(torque[turned] < 0.0))} of "
                f"{int(turned.sum())} driving rows: probably its sign is turned"
            )
            yield Hint("sign", text + self._write("reverse = true", about[0]), about[:1])
        known = np.isfinite(torque) & np.isfinite(slip)
        if known.sum() >= 4 and np.ptp(slip[known]) > 0.05 and np.ptp(torque[known]) == 0.0:
            text = (
                f"torque is {float(torque[known][0]):g} N m at every slip: probably its sensor is "
            )
            yield Hint("constant-reading", f"{text}dead", about[:1], wrong=False)

    def _traction_cause(self, traction: float, load: float) -> str:
        """The likely cause of T / (W r) outside of its range; "" where it is inside.

        Of several mistakes, that whose correction comes nearest to a usual wheel.
        traction, load: In the middle of the rows; load in N.
        """
        if LEAST_TRACTION <= traction <= MOST_TRACTION:
            return ""
        role = self._channel("torque", "motor_current")
        ratio = self.wheel.channels[role].gear_ratio.value if self.wheel and role else 1.0
        if ratio > 1.0 and LEAST_TRACTION < traction / ratio < MOST_TRACTION:
            return f"[{role}] is at the wheel already; remove gear_ratio"
        factors = [(1.0 / 9.80665, "the load is in kg and was read as N")]
        if role == "motor_current":
            factors += [(1e-3, "torque_constant is in mN m/A, or the current in mA")]
        elif role and spelling(self._unit(role)) == "mN*m":
            factors += [(1e3, f"[torque] is in N m, and was read as {self._unit(role)}")]
        else:
            factors += [(1e3, "the torque is in kN m, or the radius in mm"),
                        (9.80665, "the torque is in kgf m"),
                        (1e-2, "the torque is in N cm and was read as N m"),
                        (1e-3, "the load is in kN and was read as N") if load < _LEAST_LOAD else
                        (1e-3, "the torque is in mN m and was read as N m")]  # fmt: skip
        distance, cause = min((abs(np.log(max(traction * factor, 1e-30) / USUAL_TRACTION)), text)
                              for factor, text in factors)  # fmt: skip
        if distance < np.log(_BY_UNIT):
            return cause
        if role == "motor_current":
            return "gear_ratio or the unit of torque_constant is wrong, or the sensor is dead"
        if traction > MOST_TRACTION:
            return "the torque is wrong by a gear ratio, or the radius by its unit"
        return "the torque lacks a gear ratio, or its sensor is dead"

    def _pull(self) -> Iterator[Hint]:
        if not {"drawbar_pull", "load"} <= self.rows.keys():
            return
        pull, load = self.rows["drawbar_pull"], self.rows["load"]
        known = np.isfinite(pull) & (load > 0.0)
        if not known.any():
            return
        ratio = pull[known] / load[known]
        middle = float(np.median(np.abs(ratio)))
        if middle > _MOST_PULL:
            text = (
                f"drawbar pull is {middle:.3g} times the load in the middle of the rows, more than "
                "soil can give: probably one of them is in another unit, was not tared, or is "
                "another force"
            )
            yield Hint("pull-out-of-range", text, ("load", "drawbar_pull"))
        slip = self.rows.get("slip", np.full(pull.shape, np.nan))[known]
        if slip.size >= 4 and np.isfinite(slip).all() and np.ptp(slip) > 0.2:
            # a wheel that sinks with slip may lose pull from small slip on, but seldom all of it
            order = np.corrcoef(slip, ratio)[0, 1] if np.ptp(ratio) > 0.05 else 0.0
            late = float(np.mean(ratio[slip >= np.median(slip)]))
            if order < -0.8 and late < 0.0 and float(np.min(slip)) < 0.25:
                text = "drawbar pull falls below zero as slip grows: probably its sign is turned"
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
            if self.wheel is not None:
                cause = (
                    "it has its zero elsewhere (write tare = 'rest' in [sinkage]), or is no length"
                )
                if middle / 1000.0 < most:
                    cause = "it is in mm; write unit = 'mm' in [sinkage]"
            of = "the wheel" if self.radius is not None else "any wheel"
            text = f"sinkage is {middle:.3g} m, more than the radius of {of}: probably {cause}"
            yield Hint("sinkage-out-of-range", text, ("sinkage",))
        elif float(np.median(sinkage)) < -0.002:
            text = (
                f"sinkage is {float(np.median(sinkage)):.3g} m in the middle of the rows: probably "
            )
            yield Hint("sign", f"{text}its sign is turned", ("sinkage",), wrong=False)


def falls_with_slip(rows: Mapping[str, Floats]) -> bool:
    """Whether torque for each newton of load falls steadily over a wide range of slip (rows,).

    A wheel needs more torque as it slips more, or as much; where it is the other way round, slip is
    the ratio of travel to rim speed.
    """
    if not {"slip", "torque", "load"} <= rows.keys():
        return False
    slip = rows["slip"]
    with np.errstate(divide="ignore", invalid="ignore"):
        traction = np.asarray(rows["torque"] / rows["load"])
    good = np.isfinite(slip) & np.isfinite(traction) & (slip > 0.0) & (slip < 1.0)
    if good.sum() < 3 or np.ptp(slip[good]) < 0.15 or float(np.median(traction[good])) <= 0.0:
        return False
    varies = np.ptp(traction[good]) > 0.15 * float(np.median(traction[good]))
    return bool(varies and np.corrcoef(slip[good], traction[good])[0, 1] < -0.9)
