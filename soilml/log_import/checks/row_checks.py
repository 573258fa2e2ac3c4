"""Rows that look as if a unit, a sign, a column or the radius were wrong, with the likely cause.

Rows are those of a table of runs, the windows of a log with its map, or seconds of driving of a map
that is guessed. What an import refuses is a hint with `wrong`; other hints are remarks.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilml.log_import.checks.slip_checks import (
    LARGEST_RADIUS,
    Hint,
    RowsToCheck,
    check_definition,
    check_slips,
    check_speeds,
)

#: Range of T / (W r) of driving wheels on soil: the largest is of light wheels on cohesive snow;
#: and that to which a correction is likely to bring it.
TRACTION, _USUAL_TRACTION = (0.02, 1.5), (0.075, 1.2)
#: Largest pull over load, lever arm of torque over load, m, and sinkage, m, of any wheel.
_MOST_PULL, _MOST_LEVER, _MOST_SINKAGE = 1.2, 0.8, 0.7
_USUAL_SINKAGE = (0.02, 0.7)  # Range of the usual sinkage over the radius
_SLIPS = 0.05  # Slip from which a driving wheel has a torque worth judging
_FAR_FROM_WEIGHT = 2.5  # Factor between a load and its share of the mass that no slope explains
_TURNED = "probably its sign is turned"
_IN_THE_MIDDLE = "in the middle of the rows"


def hints_of(rows: RowsToCheck) -> list[Hint]:
    """Hints at what is wrong, or odd, in rows."""
    return [hint for check in _CHECKS for hint in check(rows)]


def _check_angles(rows: RowsToCheck) -> Iterator[Hint]:
    for name in ("slope", "slip_angle"):
        largest = float(np.max(np.abs(rows.known(name)), initial=0.0))
        if largest > (1.0 if rows.wheel is not None else 1.571):
            shown = f"the {name.replace('_', ' ')} goes to {largest:.3g} rad"
            write = rows.write("unit = 'deg'", name)
            yield Hint("unit", f"{shown}: probably it is in degrees{write}", (name,))


def _check_load(rows: RowsToCheck) -> Iterator[Hint]:
    load = rows.known("load")
    if rows.wheel is None or load.size == 0:
        return
    middle = float(np.median(load))
    shown = f"the load is {middle:.3g} N {_IN_THE_MIDDLE}"
    if middle <= 0.0:
        write = rows.write("reverse = true", "load")
        yield Hint("sign", f"{shown}: {_TURNED}{write}", ("load",))
    elif rows.weight is not None and rows.role("load"):
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


def _check_torque(rows: RowsToCheck) -> Iterator[Hint]:
    torque, slip, load = (rows.of(name) for name in ("torque", "slip", "load"))
    role = rows.role("torque", "motor_current") or "torque"
    driving = np.isfinite(torque) & (slip > _SLIPS)
    judged = driving & (load > 0.0)
    if rows.wheel is not None and not judged.any():
        judged = np.isfinite(torque) & (load > 0.0)
    lever = np.abs(rows.effort()[judged])
    if lever.size and rows.radius is not None:
        traction = lever / np.broadcast_to(rows.radius, torque.shape)[judged]
        middle = float(np.median(traction))
        if not TRACTION[0] <= middle <= TRACTION[1]:
            shown = f"torque is {middle:.3g} times W r {_IN_THE_MIDDLE}"
            text = f"{shown}: probably {_cause_of_traction(rows, role, middle)}"
            yield Hint("traction-out-of-range", text, (role, "load"))
    elif rows.wheel is not None and lever.size and np.median(lever) > _MOST_LEVER:
        text = (
            f"torque over load is {float(np.median(lever)):.3g} m {_IN_THE_MIDDLE}, more than the "
            "radius of a wheel: probably the unit of one of them is wrong, or a column is "
            "another moment or force"
        )
        yield Hint("traction-out-of-range", text, (role, "load"))
    turned = torque[driving & (torque != 0.0)]
    if turned.size >= 2 and np.mean(turned < 0.0) > 0.6:
        shown = f"torque is below zero in {int(np.sum(turned < 0.0))} of {turned.size}"
        write = rows.write("reverse = true", role)
        yield Hint("sign", f"{shown} driving rows: {_TURNED}{write}", (role,))


def _cause_of_traction(rows: RowsToCheck, role: str, traction: float) -> str:
    """The likely cause of T / (W r) outside of its range."""
    channel = rows.channel(role)
    ratio = channel.gear_ratio.value if channel else 1.0
    if ratio > 1.0 and TRACTION[0] < traction / ratio < TRACTION[1]:
        return f"[{role}] is at the wheel already; remove gear_ratio"
    if rows.radius is not None and float(np.nanmedian(rows.radius)) > LARGEST_RADIUS:
        return "the radius is in mm"
    causes = rows.units_that_give(traction, _USUAL_TRACTION, load=-1, **{role: 1})
    if role == "motor_current" and _USUAL_TRACTION[0] < traction / 1e3 < _USUAL_TRACTION[1]:
        causes = ["torque_constant is in mN m/A, or the current in mA"]
    if causes:
        return ", or ".join(causes)
    if role == "motor_current":
        return "gear_ratio or the unit of torque_constant is wrong, or the sensor is dead"
    if traction > TRACTION[1]:
        return "the torque is wrong by a gear ratio, or the radius by its unit"
    return "the torque lacks a gear ratio, or its sensor is dead"


def _check_pull(rows: RowsToCheck) -> Iterator[Hint]:
    pull, load = rows.of("drawbar_pull"), rows.of("load")
    known = np.isfinite(pull) & (load > 0.0)
    if not known.any():
        return
    ratio, slip = pull[known] / load[known], rows.of("slip")[known]
    middle = float(np.median(np.abs(ratio)))
    if middle > _MOST_PULL:
        text = (
            f"drawbar pull is {middle:.3g} times the load {_IN_THE_MIDDLE}, more than soil can "
            "give: probably one of them is in another unit, was not tared, or is another force"
        )
        yield Hint("pull-out-of-range", text, ("load", "drawbar_pull"))
    if slip.size >= 4 and np.isfinite(slip).all() and np.ptp(slip) > 0.2:
        # a wheel that sinks with slip may lose pull from small slip on, but seldom all of it
        order = np.corrcoef(slip, ratio)[0, 1] if np.ptp(ratio) > 0.05 else 0.0
        late = float(np.mean(ratio[slip >= np.median(slip)]))
        if order < -0.8 and late < 0.0 and float(np.min(slip)) < 0.25:
            text = f"drawbar pull falls below zero as slip grows: {_TURNED}"
            yield Hint("sign", text, ("drawbar_pull",), wrong=False)


def _check_sinkage(rows: RowsToCheck) -> Iterator[Hint]:
    sinkage = rows.known("sinkage")
    if sinkage.size == 0 or (rows.wheel is None and rows.radius is None):
        return
    middle = float(np.median(np.abs(sinkage)))
    most = _MOST_SINKAGE if rows.radius is None else float(np.nanmedian(rows.radius))
    if middle > most:
        usual = (_USUAL_SINKAGE[0] * most, _USUAL_SINKAGE[1] * most)
        causes = rows.units_that_give(middle, usual, sinkage=1)
        causes = causes or ["it has its zero elsewhere (tare it), or is no length"]
        of = "the wheel" if rows.radius is not None else "any wheel"
        text = f"sinkage is {middle:.3g} m, more than the radius of {of}: probably "
        yield Hint("sinkage-out-of-range", text + ", or ".join(causes), ("sinkage",))
    elif float(np.median(sinkage)) < -0.002:
        shown = f"sinkage is {float(np.median(sinkage)):.3g} m {_IN_THE_MIDDLE}"
        yield Hint("sign", f"{shown}: {_TURNED}", ("sinkage",), wrong=False)


#: Every check, causes before consequences.
_CHECKS = (
    *(_check_angles, check_speeds, check_definition, check_slips),
    *(_check_load, _check_torque, _check_pull, _check_sinkage),
)
