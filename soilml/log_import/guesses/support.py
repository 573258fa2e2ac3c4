"""Guesses that name, unit or physics do not support: their lines are marked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from soilml.log_import.channels.inputs import Inputs, moving
from soilml.log_import.guesses.columns import Candidate, name_scores
from soilml.log_import.guesses.draft import Draft, Marked

#: Lever arm of torque over load, over the radius and in m where no radius is known; pull over load;
#: sinkage over the radius, and in m.
_LEVER, _ANY_LEVER = (0.005, 1.2), (1e-4, 0.8)
_MOST_PULL, _ANY_SINKAGE = 1.2, 0.6
#: Score of a name that says its role, without a unit and beside one.
_CLEAR_NAME, _NAME = 4.0, 2.5
_JUDGED = ("load", "torque", "drawbar_pull", "sinkage")


def mark_unsupported(
    drafts: dict[str, Draft], inputs: Inputs | None, radius: float, clear: Sequence[str] = ()
) -> None:
    """Mark channels whose values no wheel has, or whose name and unit say too little.

    radius: That of the wheel, m; 0 where no log states it.
    clear: Roles that their behaviour has shown.
    """
    wrong = {} if inputs is None else _impossible(inputs, radius)
    judged = set() if inputs is None else _compared(inputs)
    for role in _JUDGED:
        draft = drafts.get(role)
        if draft is None or draft.column is None:
            continue
        said = name_scores(draft.column.name).get(role, 0.0)
        stated = draft.column.kind is not None
        if role in wrong:
            _mark(draft, f"CHANGE: {wrong[role]}")
        elif said < (_NAME if stated else _CLEAR_NAME) and role not in clear:
            _mark(draft, "CHANGE: its name alone does not say so")
        elif not stated and role not in judged and "unit" in draft.keys:
            draft.comments["unit"] = Marked("CHANGE: not stated, and nothing else shows it")


def _mark(draft: Draft, why: str) -> None:
    if not isinstance(draft.comments.get("column"), Marked):
        draft.comments["column"] = Marked(why)


def _compared(inputs: Inputs) -> set[str]:
    """Roles whose size another channel confirms: forces and torques beside each other."""
    together = {"load", "torque", "drawbar_pull"} & inputs.values.keys()
    return {"sinkage", *(together if len(together) > 1 else ())}


def _impossible(inputs: Inputs, radius: float) -> dict[str, str]:
    """Why the values of a role are those of no wheel, by role."""
    driven = moving(inputs)
    sizes = {
        role: float(np.nanpercentile(np.abs(inputs.values[role][driven]), 75))
        for role in _JUDGED
        if role in inputs.values and np.isfinite(inputs.values[role][driven]).any()
    }
    found: dict[str, str] = {}
    load = sizes.get("load", inputs.constants.get("load", 0.0))
    if load > 0.0 and "torque" in sizes:
        low, high = _LEVER if radius > 0.0 else _ANY_LEVER
        lever = sizes["torque"] / load / (radius if radius > 0.0 else 1.0)
        if not low < lever < high:
            shown = f"{lever:.3g} {'times the radius' if radius > 0.0 else 'm'}"
            found["torque"] = f"torque over load is {shown}: one of them is something else"
            found["load"] = found["torque"]
    if load > 0.0 and sizes.get("drawbar_pull", 0.0) > _MOST_PULL * load:
        found["load"] = f"the pull is {sizes['drawbar_pull'] / load:.3g} times this load"
        found["drawbar_pull"] = found["load"]
    most = radius if radius > 0.0 else _ANY_SINKAGE
    if sizes.get("sinkage", 0.0) > most and "sinkage" not in inputs.tare:
        found["sinkage"] = f"{sizes['sinkage']:.3g} m is no sinkage of a wheel"
    return found


def unused_of(role: str, kind: str, columns: Sequence[Candidate], used: set[str]) -> list[str]:
    """Columns of the unit of a role that nothing uses and that vary: one may be the role."""
    return [
        c.address
        for c in columns
        if c.kind == kind
        and c.address not in used
        and not c.about.constant
        and not (role == "sinkage" and c.about.travel > 0.6)
    ]


def used_columns(
    chosen: Mapping[str, Candidate], parts: Mapping[str, Sequence[Candidate]]
) -> set[str]:
    """The addresses of the columns of channels."""
    every = [*chosen.values(), *(c for own in parts.values() for c in own)]
    return {c.address for c in every}
