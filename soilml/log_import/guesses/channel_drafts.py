"""Drafts of the channels of a wheel: column, unit, and what stands between sensor and wheel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.assignment import Assignment
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.constants import Stated, stated_radius
from soilml.log_import.guesses.draft import (
    BY_NAME,
    Draft,
    inputs_of,
    put_signs,
    put_tares,
    put_zero_of_sinkage,
)
from soilml.log_import.guesses.role_words import (
    LEAST_PERCENT,
    MOST_FRACTION,
    USUAL,
    group,
    name_scores,
    says,
    words_of,
)
from soilml.log_import.mapping.channel_map import GEARED, ROLES, SLIP_DEFINITIONS
from soilml.log_import.mapping.written_map import Marked
from soilml.log_import.units import dimension, is_raw_signal

#: Masses that a scale shows, as forces; any other is taken for kg.
_AS_FORCE = {"g": "gf", "gram": "gf", "grams": "gf", "lb": "lbf", "pound": "lbf", "pounds": "lbf"}
_FAR_IN_M = 4.0  # A height of so many m is rather one in mm
_CELLS = "CHANGE: cells that {} are added; leave out others"
#: What several columns of a channel are.
_SEVERAL = {
    "load": Marked(_CELLS.format("carry the wheel together")),
    "drawbar_pull": Marked(_CELLS.format("pull together")),
    "sinkage": "the mean of them",
}


def draft_channels(
    chosen: dict[str, Candidate],
    run: Run,
    steady: bool,
    stated: Stated,
    parts: Mapping[str, Sequence[Candidate]],
) -> dict[str, Draft]:
    """Tables of the channels of one wheel, with units, signs and tares as the samples show them.

    `parts` are the further columns of a role: y and z, where the chosen place is x.
    """
    drafts = {r: _draft(r, column, run, stated, parts.get(r, ())) for r, column in chosen.items()}
    if (inputs := inputs_of(drafts, run, steady)) is not None:
        put_signs(drafts, inputs)
        put_tares(drafts, inputs)
        put_zero_of_sinkage(drafts, inputs, stated_radius(stated))
    return drafts


def _draft(
    role: str, column: Candidate, run: Run, stated: Stated, more: Sequence[Candidate]
) -> Draft:
    """The table of a channel; `more` are its other columns: y and z of a place, further cells."""
    draft = Draft(column=column, role=role)
    all_ = [c.address for c in (column, *more)]
    draft.put("column", all_ if more else all_[0], _SEVERAL.get(role, "") if more else "")
    columns = [values[np.isfinite(values)] for values in (run.find(c)[1] for c in all_)]
    size = float(np.percentile(np.abs(columns[0]), 90)) if columns[0].size else 0.0
    if role in ("position", "wheel_angle", "sinkage") and columns[0].size:
        size = max(float(np.ptp(values)) for values in columns if values.size)
        if role == "sinkage":  # no wheel sinks in by metres, however little that changes
            size = max(size, float(np.median(np.abs(columns[0]))) / _FAR_IN_M)
    unit, why = _unit(role, column, size)
    kind = dimension(unit)
    if role == "position" and kind == "count":
        draft.put("scale", "1 mm", Marked(f"CHANGE: travel for one count ({unit})"))
    elif is_raw_signal(unit) and USUAL[role].raw:
        why = f"CHANGE: what 1 {unit} is, from the calibration of the sensor"
        draft.put("scale", f"1 {ROLES[role][0]}", Marked(why))
    elif kind == "1" and role in ("torque", "motor_current"):
        why = Marked("CHANGE: what 1 % is, a hundredth of the rated value of the motor")
        draft.put("scale", f"0.01 {ROLES[role][0]}", why)
    else:
        draft.put("unit", unit, why)
    if "unit" in draft.keys and kind in ("count", "count/s"):
        turn, why = stated.get("counts_per_turn", ("1", "")), "stated in the log"
        asked = Marked("CHANGE: counts for one turn of the encoder")
        draft.put("counts_per_turn", float(turn[0]), why if turn[1] else asked)
    if role == "slope" and column.address.endswith("orientation.pitch"):
        why = "of a quaternion (REP 103): there the nose is down where it is positive"
        draft.put("reverse", True, why)
    if role == "slip" and MOST_FRACTION < size < LEAST_PERCENT and column.kind is None:
        why = Marked(
            f"CHANGE: it goes to {size:.2g}, which {SLIP_DEFINITIONS[0]} cannot be; where it is in "
            "per cent, write unit = '%' and remove this line"
        )
        draft.put("definition", SLIP_DEFINITIONS[2], why)
    elif role == "slip" and says(column.name, "tyres"):
        why = "as of tyres, and of Chrono's rigs; remove this line where it is 1 - v/(r omega)"
        draft.put("definition", SLIP_DEFINITIONS[2], why)
    if role == "wheel_angle" and column.wraps_at:
        draft.put("wraps_at", column.wraps_at, "it starts again there")
    if role in GEARED and (
        role != "torque" or not {"motor", "mot"}.isdisjoint(words_of(column.name))
    ):
        _put_gear_ratio(draft, role, column, stated.get("gear_ratio"))
    if role == "motor_current":
        said, line = stated.get("torque_constant", ("1.0 N m/A", ""))
        why = f"stated: {line}" if line else Marked("CHANGE: from the data sheet of the motor")
        draft.put("torque_constant", f"{said} +- 5 %", why)
        said, line = stated.get("efficiency", ("0.7", ""))
        why = "of the gearbox" if line else Marked("CHANGE: of the gearbox")
        draft.put("efficiency", f"{said} +- 0.05", why)
        draft.put("idle_current", "0 A +- 0.02 A", "what the lifted wheel takes at this speed")
    return draft


def _unit(role: str, column: Candidate, size: float) -> tuple[str, str]:
    """The unit of a column, and why: "" where the log states it.

    `size` is the 90th percentile of the values without sign, of places their range.
    """
    if column.unit and column.kind == "kg":
        force = _AS_FORCE.get(column.unit.lower(), "kgf")
        return force, f"the log says {column.unit}; as a force that is {force}"
    if column.unit and column.kind is not None:
        return column.unit, ""
    if role in ("wheel_angle", "wheel_speed") and says(column.name, "encoder"):
        return "count" if role == "wheel_angle" else "count/s", BY_NAME
    if role == "wheel_speed" and "rpm" in words_of(column.name):
        return "rpm", BY_NAME
    if role == "wheel_angle":
        range_ = column.wraps_at
        if not range_:
            return ("deg", "its values are large") if size > 60 else ("rad", "they are small")
        unit = {360.0: "deg", 2.0 * math.pi: "rad"}.get(range_, "count")
        return unit, f"it starts again at {range_:g}"
    units = USUAL[role].sizes
    why = "not stated; by the size of the values" if len(units) > 1 else "not stated"
    return next(unit for least, unit in units if size >= least), why


def _put_gear_ratio(
    draft: Draft, role: str, column: Candidate, said: tuple[str, str] | None
) -> None:
    """The turns of the motor for one of the wheel, where a column may be of the motor."""
    name = column.address.lower()
    of_motor = role == "motor_current" or "mot" in name or "before gear" in name
    if said is not None and (of_motor or "enc" in name):
        draft.put("gear_ratio", float(said[0].split()[0]), f"stated in the log: {said[1]}")
        return
    why = "turns of the motor for one of the wheel; 1 where measured at the wheel"
    if of_motor:
        why = Marked("CHANGE: turns of the motor for one of the wheel")
    draft.put("gear_ratio", 1.0, why)


def is_error(candidate: Candidate) -> bool:
    """Whether a column is the error of another one, by its name: `T_std`, `err Fz`."""
    several = len(words_of(candidate.name)) > 1
    return "±" in candidate.name or (several and says(candidate.name, "errors"))


def add_errors(drafts: dict[str, Draft], found: Assignment, errors: Sequence[Candidate]) -> None:
    """Add the columns of standard errors to the channels whose names they share."""
    for role, column in found.shared.items():
        for error in errors:
            own, plain = (
                [word for word in words_of(name) if word not in group("errors", "of_errors")]
                for name in (column.name, error.name)
            )
            if own == plain or role in name_scores(" ".join(plain)):
                why = (
                    "CHANGE where it is the scatter of samples or repeats: of the mean, it is less"
                )
                drafts[role].put("std", error.address, Marked(why))
                if error.unit and error.unit != column.unit:
                    drafts[role].put("std_unit", error.unit)
                break
