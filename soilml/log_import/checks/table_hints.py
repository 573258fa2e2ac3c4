"""Rows of a table of runs that look as if a unit, a sign or the radius were wrong.

Nothing here is impossible: hints are remarks. What is impossible, such as a slip of 2, is refused
where the table is read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.table import Table
from soilml.log_import.checks.slip_definition import definition_by_speeds, other_definition_fits
from soilml.remarks import Remark

#: Range of T / (W r) of driving wheels on soil, and its usual value.
LEAST_TRACTION, MOST_TRACTION, USUAL_TRACTION = 0.02, 1.2, 0.3
_SLIPS = 0.05  # Slip from which a driving wheel has a torque worth judging
_NO_SLIP = 1e-6  # Slip of rows whose travel and rotation are one measurement
_USUAL_SINKAGE = (0.02, 0.7)  # Range of the usual sinkage over the radius
_LEAST_LOAD = 1.0  # Load, N, below which no wheel is driven: it is then rather in kN
#: Mistakes that make T / (W r) too large, by factor. One of thousand is of the torque, or where the
#: load is that of no wheel, of the load.
_TOO_LARGE = (
    (9.80665, "the load is in kg and was taken as N"),
    (100.0, "the torque is in N cm and was taken as N m"),
)
_MILLI = (1000.0, "the torque is in mN m and was taken as N m")
_KILO = (1000.0, "the load is in kN and was taken as N")
_TOO_SMALL = (
    (1000.0, "the torque is in kN m, or the radius in mm"),
    (9.80665, "the torque is in kgf m"),
)


def table_hints(columns: Mapping[str, Floats], radius: Floats | float | None) -> list[Remark]:
    """Hints at columns in a wrong unit or with a wrong sign, most important first.

    columns: Columns (rows,) of a table of runs by name: `slip`, `load_N`, `torque_Nm`, ...
    radius: Radius of the wheel of all rows or of each row (rows,), m; None where it is not known.

    Examples
    --------
    >>> import numpy as np
    >>> slip, load = np.array([0.1, 0.3, 0.5]), np.full(3, 60.0)
    >>> table_hints({"slip": slip, "load_N": load, "torque_Nm": np.array([1.5, 3, 4])}, 0.15)
    []
    >>> wrong = {"slip": slip, "load_N": load / 9.81, "torque_Nm": np.array([1.5, 3, 4])}
    >>> [(hint.code, hint.about) for hint in table_hints(wrong, 0.15)]
    [('traction-out-of-range', ('torque_Nm', 'load_N'))]
    """
    found: list[Remark] = []
    for check in (
        _traction,
        _signs,
        _slip,
        _definition,
        _constant_torque,
        _pull,
        _sinkage,
        _angles,
    ):
        found += check(columns, radius)
    return found


def traction_cause(traction: float, load: float) -> str:
    """The likely cause of T / (W r) outside of its range; "" where it is inside.

    traction, load: In the middle of the rows; load in N.
    """
    if LEAST_TRACTION <= traction <= MOST_TRACTION:
        return ""
    if traction > MOST_TRACTION:
        mistakes = (*_TOO_LARGE, _KILO if load < _LEAST_LOAD else _MILLI)
        options = [(traction / factor, text) for factor, text in mistakes]
        other = "the torque is wrong by a gear ratio, or the radius by its unit"
    else:
        options = [(traction * factor, text) for factor, text in _TOO_SMALL]
        other = "the torque lacks a gear ratio, or its sensor is dead"
    distance, text = min((abs(np.log(max(q, 1e-30) / USUAL_TRACTION)), text) for q, text in options)
    return text if distance < np.log(4.0) else other


def falls_with_slip(columns: Mapping[str, Floats]) -> bool:
    """Whether torque for each newton of load falls steadily over a wide range of slip (rows,).

    The columns are `slip`, `torque` and `load`. A wheel needs more torque as it slips more, or as
    much; where it is the other way round, slip is the ratio of travel to rim speed.
    """
    if not {"slip", "torque", "load"} <= columns.keys():
        return False
    slip = columns["slip"]
    with np.errstate(divide="ignore", invalid="ignore"):
        traction = np.asarray(columns["torque"] / columns["load"])
    good = np.isfinite(slip) & np.isfinite(traction) & (slip > 0.0) & (slip < 1.0)
    if good.sum() < 3 or np.ptp(slip[good]) < 0.15 or float(np.median(traction[good])) <= 0.0:
        return False
    varies = np.ptp(traction[good]) > 0.15 * float(np.median(traction[good]))
    return bool(varies and np.corrcoef(slip[good], traction[good])[0, 1] < -0.9)


def _definition(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    named = {"slip": "slip", "torque": "torque_Nm", "load": "load_N"}
    held = {key: columns[name] for key, name in named.items() if name in columns}
    rim = columns.get("rim_speed_m_s")
    if rim is None and "wheel_speed_rad_s" in columns and radius is not None:
        rim = columns["wheel_speed_rad_s"] * radius
    found = None
    if rim is not None and {"slip", "speed_m_s"} <= columns.keys():
        found = definition_by_speeds(columns["slip"], rim, columns["speed_m_s"])
    if found is not None:
        definition, unit = found
        yield Remark(
            "slip-definition",
            "slip disagrees with the speeds of rim and travel, and agrees as "
            f"{definition}{' in per cent' if unit else ''}: needed is 1 - v/(r omega)",
            ("slip", "speed_m_s"),
        )
    elif falls_with_slip(held):
        yield Remark(
            "slip-definition",
            "torque falls as slip grows: is slip the ratio of travel to rim speed, v/(r omega)? "
            "Needed is 1 less it",
            ("slip", "torque_Nm"),
        )


def _traction(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    if radius is None or not {"slip", "load_N", "torque_Nm"} <= columns.keys():
        return
    load = columns["load_N"] * radius
    judged = np.isfinite(columns["torque_Nm"]) & (load > 0.0) & (columns["slip"] > _SLIPS)
    if not judged.any():
        return
    traction = np.abs(columns["torque_Nm"][judged]) / load[judged]
    middle = float(np.median(traction))
    if cause := traction_cause(middle, float(np.median(columns["load_N"][judged]))):
        yield Remark(
            "traction-out-of-range",
            f"torque is {middle:.3g} times W r in the middle of the rows: probably {cause}",
            ("torque_Nm", "load_N"),
        )
    elif (odd := np.flatnonzero(traction > 2.0 * MOST_TRACTION)).size:
        row = int(np.flatnonzero(judged)[odd[0]]) + 1
        yield Remark(
            "odd-row",
            f"torque is {float(traction[odd[0]]):.3g} times W r in row {row}, and at most "
            f"{float(np.sort(traction)[-odd.size - 1]):.2g} times in the others: look at that row",
            ("torque_Nm",),
        )


def _signs(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    if not {"slip", "torque_Nm"} <= columns.keys():
        return
    slip, torque = columns["slip"], columns["torque_Nm"]
    judged = np.isfinite(torque) & (slip > _SLIPS) & (torque != 0.0)
    if judged.sum() >= 2 and np.mean(torque[judged] < 0.0) > 0.6:
        yield Remark(
            "sign",
            f"torque is below zero in {int(np.sum(torque[judged] < 0.0))} of {int(judged.sum())} "
            "driving rows: probably its sign is turned",
            ("torque_Nm",),
        )


def _slip(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    slip = columns.get("slip")
    if slip is None or slip.size < 3:
        return
    lowest = float(np.min(slip))
    if lowest > 0.9:
        yield Remark(
            "slip-unit",
            f"slip is {lowest:.2g} or more in all rows: probably the rotation was measured before "
            "a gearbox, or is in another unit",
            ("slip",),
        )
    elif lowest > 0.45 and np.ptp(slip) > 0.03:
        yield Remark(
            "radius-as-diameter",
            f"slip is {lowest:.2g} or more in all rows: is the radius given as diameter? (slip "
            f"would begin at {2.0 * lowest - 1.0:.2g})",
            ("slip",),
        )
    elif lowest < -0.3 and float(np.max(slip)) < 0.0:
        yield Remark(
            "slip-negative",
            f"slip is below zero in all rows, {lowest:.2g} at least: are rim and travel speed "
            "exchanged, or is the radius too small?",
            ("slip",),
        )
    elif float(np.max(np.abs(slip))) < _NO_SLIP:
        yield Remark(
            "one-sensor",
            "slip is 0 in all rows: was the travel computed from the rotation of the wheel?",
            ("slip",),
        )
    elif float(np.max(np.abs(slip))) < 0.01:
        yield Remark(
            "slip-unit", "slip is below 0.01 in all rows: was it divided by 100 twice?", ("slip",)
        )


def _constant_torque(
    columns: Mapping[str, Floats], radius: Floats | float | None
) -> Iterator[Remark]:
    if not {"slip", "torque_Nm"} <= columns.keys():
        return
    known = np.isfinite(columns["torque_Nm"])
    if known.sum() >= 4 and np.ptp(columns["slip"][known]) > 0.05:
        torque = columns["torque_Nm"][known]
        if np.ptp(torque) == 0.0:
            yield Remark(
                "constant-reading",
                f"torque is {float(torque[0]):g} N m at every slip: probably its sensor is dead",
                ("torque_Nm",),
            )


def _pull(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    if not {"load_N", "drawbar_pull_N"} <= columns.keys():
        return
    known = np.isfinite(columns["drawbar_pull_N"])
    if not known.any():
        return
    ratio = columns["drawbar_pull_N"][known] / columns["load_N"][known]
    if float(np.median(np.abs(ratio))) > 1.2:
        yield Remark(
            "pull-out-of-range",
            f"drawbar pull is {float(np.median(np.abs(ratio))):.3g} times the load in the middle "
            "of the rows: probably one of them is in another unit, or the sensor was not tared",
            ("drawbar_pull_N", "load_N"),
        )
    slip = columns.get("slip")
    if slip is not None and known.sum() >= 4 and np.ptp(slip[known]) > 0.2:
        # a wheel that sinks with slip may lose pull from small slip on, but seldom all of it
        order = np.corrcoef(slip[known], ratio)[0, 1] if np.ptp(ratio) > 0.05 else 0.0
        late = ratio[slip[known] >= np.median(slip[known])]
        turned = order < -0.8 and float(np.mean(late)) < 0.0
        if turned and float(np.min(slip[known])) < 0.25:
            yield Remark(
                "sign",
                "drawbar pull falls below zero as slip grows: probably its sign is turned",
                ("drawbar_pull_N",),
            )


def _sinkage(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    sinkage = columns.get("sinkage_m")
    if sinkage is None or not np.isfinite(sinkage).any():
        return
    middle = float(np.nanmedian(sinkage))
    if radius is not None and middle > (one := float(np.nanmedian(radius))):
        units = [
            unit
            for unit, factor in (("cm", 100.0), ("mm", 1000.0))
            if _USUAL_SINKAGE[0] < middle / factor / one < _USUAL_SINKAGE[1]
        ]
        unit = " or ".join(units) or "another unit"
        yield Remark(
            "unit",
            f"sinkage is {middle:.3g} m, more than the radius: probably it is in {unit}",
            ("sinkage_m",),
        )
    elif middle < -0.002:
        yield Remark(
            "sign",
            f"sinkage is {middle:.3g} m in the middle of the rows: probably its sign is turned",
            ("sinkage_m",),
        )


def _angles(columns: Mapping[str, Floats], radius: Floats | float | None) -> Iterator[Remark]:
    for name in ("slip_angle_rad", "slope_rad"):
        values = columns.get(name)
        if values is not None and np.isfinite(values).any() and np.nanmax(np.abs(values)) > 1.571:
            yield Remark(
                "unit",
                f"{name} goes to {np.nanmax(np.abs(values)):.3g}: probably it is in degrees",
                (name,),
            )


def table_remarks(table: Table, case: Case | None, radius: float | None = None) -> list[Remark]:
    """A remark for each oddity of a table; see `table_hints` and `other_definition_fits`.

    The radius of the wheel (m) is that of the case, else `radius`; None where it is not known.
    """
    used = table.rows(table.answered)
    if case is not None and case.gears:
        used = with_rover_columns(case, used)
    radii = radius if case is None else _radii(used, case)
    if not len(used):
        return []
    hints = table_hints(used.columns, radii)
    told = any(hint.code == "slip-definition" for hint in hints)
    if case is not None and not case.gears and not told and other_definition_fits(case, used):
        text = (
            "the rows fit the model far better where slip is taken as (r omega - v)/v: how was it "
            "defined? Needed is 1 - v/(r omega), which is 0.5 where the rim goes twice as far as "
            "the wheel travels; (r omega - v)/v is 1 there"
        )
        hints.append(Remark("slip-definition", text, ("slip",)))
    return [replace(hint, text=f"{table.source}: {hint.text}") for hint in hints]


def _radii(table: Table, case: Case) -> NDArray[np.float64] | None:
    """Radius of each row, (rows,), m; None for a gear without a radius."""
    if not case.gears:
        radius = getattr(case.model.gear, "radius", None)
        return None if radius is None else np.full(len(table), float(radius))
    first = next(iter(case.gears))
    names = table["gear"] if "gear" in table else np.full(len(table), first)
    radii = {name: getattr(model.gear, "radius", None) for name, model in case.gears.items()}
    found = [radii.get(str(name) or first) for name in names]
    return None if any(r is None for r in found) else np.asarray(found, dtype=np.float64)
