"""Rows that look as if a unit, a sign, a column or the radius were wrong, with the likely cause.

Rows are those of a table of runs, the windows of a log with its map, or seconds of driving of a map
that is guessed. What an import refuses is a hint with `wrong`; other hints are remarks.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilml.log_import.checks.checked_rows import Hint, RowsToCheck
from soilml.log_import.checks.slip_hints import definition_hints, rates_hints, slip_hints

#: Range of T / (W r) of driving wheels on soil: the largest is of light wheels on cohesive snow.
TRACTION = (0.02, 1.5)
_USUAL_TRACTION = 0.3
#: Largest pull over load, lever arm of torque over load, m, and sinkage, m, of any wheel.
_MOST_PULL, _MOST_LEVER, _MOST_SINKAGE = 1.2, 0.8, 0.7
_USUAL_SINKAGE = (0.02, 0.7)  # Range of the usual sinkage over the radius
_SLIPS = 0.05  # Slip from which a driving wheel has a torque worth judging
_LEAST_LOAD = 1.0  # Load, N, below which no wheel is driven: it is then rather in kN
_FAR_FROM_WEIGHT = 2.5  # Factor between a load and its share of the mass that no slope explains
_BY_UNIT = 4.0  # How far from the usual T / (W r) another unit may bring it, as a factor
_TURNED = "probably its sign is turned"


def _angles(rows: RowsToCheck) -> Iterator[Hint]:
    for name in ("slope", "slip_angle"):
        largest = float(np.max(np.abs(rows.known(name)), initial=0.0))
        if largest > (1.0 if rows.wheel is not None else 1.571):
            shown = f"the {name.replace('_', ' ')} goes to {largest:.3g} rad"
            write = rows.write("unit = 'deg'", name)
            yield Hint("unit", f"{shown}: probably it is in degrees{write}", (name,))


def _load(rows: RowsToCheck) -> Iterator[Hint]:
    load = rows.known("load")
    if rows.wheel is None or load.size == 0:
        return
    middle = float(np.median(load))
    shown = f"the load is {middle:.3g} N in the middle of the rows"
    if middle <= 0.0:
        write = rows.write("reverse = true", "load")
        yield Hint("sign", f"{shown}: {_TURNED}{write}", ("load",))
    elif rows.weight is not None and rows.channel("load"):
        least, most = rows.weight
        if 0.7 < most / middle / 9.80665 < 1.4:
            text = f"the load of {middle:.3g} N is a tenth of the weight: probably it is in kg"
            yield Hint("unit", text + rows.write("unit = 'kgf'", "load"), ("load",))
        elif not least / _FAR_FROM_WEIGHT < middle < _FAR_FROM_WEIGHT * most:
            text = (
                f"{shown}, and the mass of [vehicle] gives {most:.3g} N for each wheel: "
                "probably one of them is wrong, or the column is another force"
            )
            yield Hint("load-not-of-mass", text, ("load",))


def _torque(rows: RowsToCheck) -> Iterator[Hint]:
    torque, slip, load = (rows.of(name) for name in ("torque", "slip", "load"))
    about = (rows.channel("torque", "motor_current") or "torque", "load")
    driving = np.isfinite(torque) & (slip > _SLIPS)
    judged = driving & (load > 0.0)
    if rows.wheel is not None and not judged.any():
        judged = np.isfinite(torque) & (load > 0.0)
    if judged.any() and rows.radius is not None:
        lever = np.abs(torque[judged]) / load[judged]
        traction = lever / np.broadcast_to(rows.radius, torque.shape)[judged]
        middle, largest = float(np.median(traction)), float(np.max(traction))
        if cause := _traction_cause(rows, middle, float(np.median(load[judged]))):
            shown = f"torque is {middle:.3g} times W r in the middle of the rows"
            yield Hint("traction-out-of-range", f"{shown}: probably {cause}", about)
        elif rows.wheel is None and largest > 2 * TRACTION[1]:
            row = int(np.flatnonzero(judged)[np.argmax(traction)]) + 1
            shown = f"torque is {largest:.3g} times W r in row {row}"
            yield Hint("odd-row", f"{shown}: look at that row", about[:1], wrong=False)
    elif judged.any() and rows.wheel is not None:
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
        write = rows.write("reverse = true", about[0])
        yield Hint("sign", f"{shown} driving rows: {_TURNED}{write}", about[:1])
    known = np.isfinite(torque) & np.isfinite(slip)
    if known.sum() >= 4 and np.ptp(slip[known]) > 0.05 and np.ptp(torque[known]) == 0.0:
        text = f"torque is {float(torque[known][0]):g} N m at every slip: probably its sensor "
        yield Hint("constant-reading", f"{text}is dead", about[:1], wrong=False)


def _traction_cause(rows: RowsToCheck, traction: float, load: float) -> str:
    """The likely cause of T / (W r) outside of its range; "" where it is inside.

    Of several mistakes, that whose correction comes nearest to a usual wheel.
    traction, load: In the middle of the rows; load in N.
    """
    low, high = TRACTION
    if low <= traction <= high:
        return ""
    role = rows.channel("torque", "motor_current") or "torque"
    channel = rows.wheel.channels.get(role) if rows.wheel is not None else None
    ratio = channel.gear_ratio.value if channel else 1.0
    if channel and ratio > 1.0 and low < traction / ratio < high:
        return f"[{role}] is at the wheel already; remove gear_ratio"
    factors = {"the load is in kg and was read as N": 1.0 / 9.80665}
    if role == "motor_current":
        factors["torque_constant is in mN m/A, or the current in mA"] = 1e-3
    else:
        read, others = rows.read_as(role)
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


def _pull(rows: RowsToCheck) -> Iterator[Hint]:
    pull, load = rows.of("drawbar_pull"), rows.of("load")
    known = np.isfinite(pull) & (load > 0.0)
    if not known.any():
        return
    ratio, slip = pull[known] / load[known], rows.of("slip")[known]
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


def _sinkage(rows: RowsToCheck) -> Iterator[Hint]:
    sinkage = rows.known("sinkage")
    if sinkage.size == 0 or (rows.wheel is None and rows.radius is None):
        return
    middle = float(np.median(np.abs(sinkage)))
    most = _MOST_SINKAGE if rows.radius is None else float(np.nanmedian(rows.radius))
    if middle > most:
        units = [unit for unit, size in rows.read_as("sinkage")[1].items()
                 if _USUAL_SINKAGE[0] < middle * size / most < _USUAL_SINKAGE[1]]  # fmt: skip
        cause = f"it is in {' or '.join(units) or 'another unit'}"
        if rows.wheel is not None and middle / 1000.0 < most:
            cause = "it is in mm; write unit = 'mm' in [sinkage]"
        elif rows.wheel is not None:
            cause = "it has its zero elsewhere (write tare = 'rest' in [sinkage]), or is no length"
        of = "the wheel" if rows.radius is not None else "any wheel"
        text = f"sinkage is {middle:.3g} m, more than the radius of {of}: probably {cause}"
        yield Hint("sinkage-out-of-range", text, ("sinkage",))
    elif float(np.median(sinkage)) < -0.002:
        shown = f"sinkage is {float(np.median(sinkage)):.3g} m in the middle of the rows"
        yield Hint("sign", f"{shown}: {_TURNED}", ("sinkage",), wrong=False)


#: Every check, causes before consequences.
_CHECKS = (_angles, rates_hints, definition_hints, slip_hints, _load, _torque, _pull, _sinkage)


def hints_of(rows: RowsToCheck) -> list[Hint]:
    """Hints at what is wrong, or odd, in rows."""
    return [hint for check in _CHECKS for hint in check(rows)]
