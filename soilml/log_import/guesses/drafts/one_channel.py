"""The draft of one channel: column, unit, and what stands between sensor and wheel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns.candidates import CALIBRATED, Candidate
from soilml.log_import.guesses.columns.column_words import words_of
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.guesses.drafts.unit_guess import guess_rotation_unit, guess_unit
from soilml.log_import.guesses.stated_constants import stated_radius
from soilml.log_import.guesses.stated_scales import stated_scale
from soilml.log_import.mapping.channel import ROLES
from soilml.log_import.units.conversion import dimension
from soilml.log_import.units.unit_names import is_raw_signal

#: What several columns of a channel are.
_SEVERAL = {
    "load": "CHANGE: cells that carry the wheel together are added; leave out others",
    "drawbar_pull": "CHANGE: cells that pull together are added; leave out others",
    "sinkage": "the mean of them",
    "slope": "CHANGE: accelerations forward, to the left and up; or a quaternion x, y, z, w",
}


def draft_of(
    role: str,
    column: Candidate,
    run: Run,
    stated: dict[str, tuple[str, str]],
    more: Sequence[Candidate],
) -> Draft:
    """The table of a channel; `more` are its other columns: y and z of a place, further cells."""
    draft = Draft(column=column)
    draft.put(
        "column", [c.address for c in (column, *more)] if more else column.address,
        _SEVERAL.get(role, "") if more else "",
    )  # fmt: skip
    _, values = run.find(column.address)
    known = values[np.isfinite(values)]
    moving = float(np.percentile(np.abs(known), 90)) if known.size else 0.0
    if role in ("position", "wheel_angle", "sinkage") and known.size:
        moving = max(float(np.nanmax(v) - np.nanmin(v)) for v in
                     (run.find(c.address)[1] for c in (column, *more)))  # fmt: skip
    if role == "slope" and more:
        return draft  # an angle, whatever the unit of accelerations
    unit, why = guess_unit(role, column, moving)
    if role == "position" and dimension(unit) == "count":
        draft.put("scale", "1 mm", f"CHANGE: travel for one count ({unit})")
    elif is_raw_signal(unit) and role in CALIBRATED:
        lines = [line for recording in run.recordings for line in recording.about]
        known_scale, line = stated_scale(column.address, unit, role, ROLES[role][0], lines)
        example = f"1 {ROLES[role][0]}"
        draft.put(
            "scale", known_scale or example,
            f"for 1 {unit}; stated in the log: {line[:60]}" if known_scale else
            f"CHANGE: what 1 {unit} is, from the calibration of the sensor",
        )  # fmt: skip
    elif dimension(unit) == "1" and role in ("torque", "motor_current"):
        rated, one = ("torque", "N m") if role == "torque" else ("current", "A")
        said = stated.get(f"rated_{rated}")
        draft.put(
            "scale",
            f"{float(said[0].split()[0]) / 100:g} {' '.join(said[0].split()[1:]) or one}"
            if said
            else f"0.01 {one}",
            f"a hundredth of the rated {rated} of the log: {said[1][:60]}"
            if said
            else f"CHANGE: what 1 % is, a hundredth of the rated {rated}",
        )
    elif dimension(unit) in ("count", "count/s"):
        number = stated.get("counts_per_turn", ("1", ""))[0]
        known_turn = "counts_per_turn" in stated
        draft.put("unit", unit, why)
        draft.put(
            "counts_per_turn",
            float(number) if known_turn else 1.0,
            "stated in the log" if known_turn else "CHANGE: counts for one turn of the encoder",
        )
    else:
        draft.put("unit", unit, why)
    if role == "slope" and column.address.endswith("orientation.pitch"):
        draft.put(
            "reverse",
            True,
            "of a quaternion (REP 103): there the nose is down where it is positive",
        )
    if role == "slip" and "kappa" in words_of(column.name):
        why = "of a kappa, as of tyres; remove this line where it is 1 - v/(r omega)"
        draft.put("definition", "(r omega - v)/v", why)
    if role == "wheel_angle" and column.about.wraps_at:
        draft.put("wraps_at", column.about.wraps_at, "it starts again there")
    if role in ("wheel_angle", "wheel_speed", "motor_current"):
        ratio = stated.get("gear_ratio")
        if ratio is not None and _is_motor(column, role):
            draft.put("gear_ratio", float(ratio[0].split()[0]), f"stated in the log: {ratio[1]}")
        else:
            why = "turns of the motor for one of the wheel; 1 where measured at the wheel"
            if role == "motor_current" or "mot" in column.address.lower():
                why = "CHANGE: turns of the motor for one of the wheel"
            draft.put("gear_ratio", 1.0, why)
    if role == "motor_current":
        constant = stated.get("torque_constant")
        if constant is not None:
            draft.put("torque_constant", f"{constant[0]} +- 5 %", f"stated: {constant[1]}")
        else:
            draft.put(
                "torque_constant", "1.0 N m/A +- 5 %", "CHANGE: from the data sheet of the motor"
            )
        efficiency = stated.get("efficiency", ("0.7", ""))[0]
        why = "of the gearbox" if "efficiency" in stated else "CHANGE: of the gearbox"
        draft.put("efficiency", f"{efficiency} +- 0.05", why)
        draft.put("idle_current", "0 A +- 0.02 A", "what the lifted wheel takes at this speed")
    return draft


def _is_motor(column: Candidate, role: str) -> bool:
    words = column.address.lower()
    return role == "motor_current" or "mot" in words or "enc" in words


def rotation_unit(drafts: dict[str, Draft], stated: dict[str, tuple[str, str]]) -> None:
    """Find the unit of a rotation rate that states none beside the travel speed."""
    rotation, ground = drafts.get("wheel_speed"), drafts.get("ground_speed")
    if rotation is None or rotation.column is None or rotation.keys["unit"] != "rad/s":
        return
    if rotation.column.unit or ground is None or ground.column is None:
        return
    factor = {"mm/s": 1e-3, "cm/s": 1e-2}.get(ground.keys["unit"], 1.0)
    radius = stated_radius(stated)
    unit, why = guess_rotation_unit(
        rotation.column.about.size, factor * ground.column.about.size, radius
    )
    rotation.put("unit", unit, why)
