"""What speaks for each guessed channel: a guess without evidence is marked in the map.

A channel stands without a mark where its unit is stated and a full word of its role is in its
name, or where another channel confirms it. The others are marked, with the second-best column.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.inputs import Inputs, moving
from soilml.log_import.checks.row_hints import FAR_FROM_WEIGHT
from soilml.log_import.checks.speed_hints import slip_without_cause
from soilml.log_import.guesses.columns import Candidate, says_role, wheel_word
from soilml.log_import.guesses.draft import Draft, driving_means, travel_over_rotation
from soilml.log_import.mapping.channel_map import UNITS
from soilml.log_import.mapping.written_map import Marked

#: What no wheel exceeds and what confirms a guess. Lever arm of torque over load, over the radius
#: and in m where no radius is known; pull over load; sinkage in m.
_LEVER, _ANY_LEVER = (0.005, 1.2), (1e-4, 0.8)
_MOST_PULL, _ANY_SINKAGE = 1.2, 0.6
#: T / (W r) of wheels on soil, and in m where no radius is known: outside of it by a factor of 10,
#: a unit is another one.
_TRACTION, _USUAL_LEVER = (0.02, 1.2), (0.004, 0.25)
#: Travel over rotation of wheels, m; slips of a driven wheel, 5th to 95th percentile.
_RADII, _SLIPS = (0.02, 0.6), (-0.3, 0.97)
_TOGETHER, _FEWEST = 0.8, 6  # Correlation that confirms, and fewest means that tell it
_OF_MASS = (0.5, 2.0)  # Load over its share of the stated mass
_SAME_SIZE = 0.95  # Ratio of the sizes of two columns that may hold the same
#: Largest fraction that a column of slip may hold, and the least one of per cent: (r omega - v)/v
#: lies between.
MOST_FRACTION, LEAST_PERCENT = 1.0, 5.0
BY_NAME = "by its name"  # Why a unit is known that no brackets state, as of ticks and rpm
_PAIRS = (("torque", "drawbar_pull"), ("motor_current", "drawbar_pull"), ("torque", "slip"),
          ("sinkage", "slip"), ("sinkage", "torque"), ("motor_current", "torque"))  # fmt: skip


@dataclass
class GuessEvidence:
    """What speaks for a column in a role."""

    role: str
    column: str
    unit: str  # The stated unit; "" where it was guessed
    word: bool  # Whether a full word of the role is in the name
    rival: str  # A column of other values whose name says as much; "" for none
    second: str  # The column that would be the next one; "" for none
    physics: str = ""  # What other channels say for it and against it
    against: str = ""

    @property
    def silent(self) -> bool:
        """Whether the channel needs no mark: the one rule."""
        proved = bool((self.unit and self.word) or self.physics)
        return proved and not (self.against or self.rival)

    @property
    def mark(self) -> str:
        """What the mark says, and which column might be meant otherwise."""
        lacks = {"its name alone does not say so": self.word, "no unit is stated": self.unit}
        why = self.against or ", and ".join(text for text, there in lacks.items() if not there)
        if not why:
            return f"CHANGE: {self.rival!r} fits as well"
        return f"CHANGE: {why}" + (f"; else perhaps {self.second!r}" if self.second else "")

    def __str__(self) -> str:
        return (
            f"[{self.role}] {self.column}: {'no mark' if self.silent else self.mark}\n"
            f"    unit {self.unit or 'not stated'}; "
            f"{'a' if self.word else 'no'} full word of the role in the name; "
            f"physics: {self.against or self.physics or 'nothing confirms it'}\n"
        )


def weigh(
    drafts: Mapping[str, Draft],
    inputs: Inputs | None,
    constants: Mapping[str, float],
    seconds: Mapping[str, Sequence[Candidate]],
    columns: Sequence[Candidate],
    shown: Mapping[str, str],
    doubts: Mapping[str, str],
) -> list[GuessEvidence]:
    """The evidence for each channel of a wheel that is a column; those without are marked.

    inputs: Samples as the drafts read them; None where they cannot be read.
    constants: Stated `radius` (m), and `weight` (N) on each wheel with the `least_weight` that it
        may be where nothing says how many carry it, as far as they are known.
    seconds: The next columns by role.
    shown, doubts: What the behaviour of several alike columns has shown, and what the rows of the
        map say against it, by role.
    """
    found = {}
    used = {draft.column.address for draft in drafts.values()}
    for role, draft in drafts.items():
        own, others = draft.column, seconds.get(role, ())
        stated = own.unit if own.kind not in (None, "other") else ""
        if draft.comments.get("unit") == BY_NAME:
            stated = str(draft.keys["unit"])
        alike = [c for c in columns if c.kind == UNITS[role] and not c.about.constant]
        left = [c.address for c in (*others, *alike) if c.address not in used]
        found[role] = GuessEvidence(
            role, own.address, stated, says_role(role, own.name) or says_role(role, own.address),
            _rival(role, own, others), left[0] if left else "",
        )  # fmt: skip
        if role in shown and not isinstance(shown[role], Marked) and stated:
            found[role].physics = shown[role]
    if inputs is not None:
        for role, why in _impossible(inputs, constants).items():
            if role in found:
                found[role].against = why
        for role, why in _confirmed(found, drafts, inputs, constants, columns):
            if role in found and not found[role].physics:
                found[role].physics = why
    for role, one in found.items():
        comments = drafts[role].comments
        if not drafts[role].is_marked:  # one mark suffices
            one.against = one.against or doubts.get(role, "")
        said = comments.get("column", "")
        if not one.silent and not isinstance(said, Marked):
            comments["column"] = Marked(f"{one.mark}; {said}" if said else one.mark)
    return list(found.values())


def _rival(role: str, own: Candidate, others: Sequence[Candidate]) -> str:
    """A column of other values whose name fits a role as well; "" for none, as of other wheels."""
    for other in others:
        same = other.kind == own.kind and other.scores.get(role, 0.0) >= own.scores[role]
        sizes = sorted((own.about.size, other.about.size))
        if same and not wheel_word(other.address) and sizes[0] < _SAME_SIZE * sizes[1]:
            return other.address
    return ""


def _confirmed(
    found: Mapping[str, GuessEvidence],
    drafts: Mapping[str, Draft],
    inputs: Inputs,
    constants: Mapping[str, float],
    columns: Sequence[Candidate],
) -> Iterator[tuple[str, str]]:
    """Roles that another channel confirms, and how."""
    means, radius = driving_means(inputs), constants.get("radius", 0.0)
    turning = next((r for r in ("rim_speed", "wheel_speed", "wheel_angle") if r in found), "")
    travel = next((r for r in ("ground_speed", "position") if r in found), "")
    ratio = travel_over_rotation(means)
    ratio = ratio[np.isfinite(ratio)]
    # the ratio of two measurements has some scatter
    if turning and travel and ratio.size and (ratio.size < 3 or np.ptp(ratio) > 1e-9 * ratio.max()):
        ratio = float(drafts[turning].keys.get("gear_ratio", 1.0)) * ratio
        radius_here = 1.0 if turning == "rim_speed" else radius
        low, high = (float(x) for x in np.percentile(ratio, [5, 95]))
        slips = (1.0 - high / radius_here, 1.0 - low / radius_here) if radius_here else (9, 9)
        if _SLIPS[0] < slips[0] and slips[1] < _SLIPS[1]:
            why = f"slip is {slips[0]:.2g} to {slips[1]:.2g}"
            yield from ((role, why) for role in (turning, travel))
        of_wheel = _RADII[0] < high < _RADII[1]
        if found[turning].unit and found[travel].unit and not radius and of_wheel:
            why = f"travel over rotation is {high:.2g} m, as of a wheel"
            yield from ((role, why) for role in (turning, travel))
        radius = radius or (high if of_wheel else 0.0)
    size = float(np.nanmedian(np.abs(means["load"]))) if "load" in means else 0.0
    weight = constants.get("weight", 0.0)
    if size and weight and _OF_MASS[0] < size / weight < _OF_MASS[1]:
        yield "load", f"the stated mass gives {weight:.3g} N, and it shows {size:.3g} N"
    if size and "torque" in means:
        lever = float(np.nanmedian(np.abs(means["torque"]))) / size
        low, high = (r * radius for r in _TRACTION) if radius else _USUAL_LEVER
        why = f"torque over load is {lever:.2g} m, as of a wheel"
        units = {role: role in found and found[role].unit for role in ("torque", "load")}
        for role, other in (("torque", "load"), ("load", "torque")) if low < lever < high else ():
            alone = sum(c.kind == UNITS[role] for c in columns) == 1
            known = role in found and (found[role].word or (units[role] and alone))
            if known and (units[other] or (other == "load" and other not in found)):
                yield role, why
    for pair in _PAIRS:
        if _correlation(means, *pair) > _TOGETHER:
            why = f"{' and '.join(pair).replace('_', ' ')} vary together"
            yield from ((r, why) for r in pair if r in found and found[r].unit)
    if "slip" in means and "slip" in found and found["slip"].word:
        low, high = float(np.nanmin(means["slip"])), float(np.nanmax(means["slip"]))
        given = 100.0 * high if drafts["slip"].keys.get("unit") == "%" else high
        known = 0.02 < given <= MOST_FRACTION or given >= LEAST_PERCENT
        if low >= -1.0 and high <= 1.0 and known and not drafts["slip"].is_marked:
            yield "slip", f"it lies between {low:.2g} and {high:.2g}"


def _correlation(means: Mapping[str, Floats], one: str, other: str) -> float:
    """Correlation of two channels, without sign; 0 where too few means tell it."""
    if not {one, other} <= means.keys():
        return 0.0
    both = np.stack([means[one], means[other]])
    both = both[:, np.isfinite(both).all(axis=0)]
    if both.shape[1] < _FEWEST or not np.ptp(both, axis=1).all():
        return 0.0
    return abs(float(np.corrcoef(*both)[0, 1]))


def _impossible(inputs: Inputs, constants: Mapping[str, float]) -> dict[str, str]:
    """Why the values of a role are those of no wheel, by role."""
    driven, radius = moving(inputs), constants.get("radius", 0.0)
    sizes = {
        role: float(np.nanpercentile(np.abs(inputs.values[role][driven]), 75))
        for role in ("load", "torque", "drawbar_pull", "sinkage")
        if role in inputs.values and np.isfinite(inputs.values[role][driven]).any()
    }
    found: dict[str, str] = {}
    means = driving_means(inputs)
    ratio = travel_over_rotation(means)
    if ratio.size and "torque" in means:
        with np.errstate(divide="ignore", invalid="ignore"):
            effort = means["torque"] / means.get("load", 1.0)
        if slip_without_cause(ratio, effort):
            why = "it follows the rotation however much the wheel works: computed from it?"
            found |= dict.fromkeys(("ground_speed", "position"), why)
    load = sizes.get("load", inputs.constants.get("load", 0.0))
    if "load" in sizes and "weight" in constants and not (
        constants["least_weight"] < FAR_FROM_WEIGHT * load
        and load < FAR_FROM_WEIGHT * constants["weight"]
    ):  # fmt: skip
        share = load / constants["weight"]
        found["load"] = f"it is {share:.2g} times what the stated mass gives for each wheel"
    if load > 0.0 and "torque" in sizes:
        low, high = _LEVER if radius > 0.0 else _ANY_LEVER
        lever = sizes["torque"] / load / (radius if radius > 0.0 else 1.0)
        if not low < lever < high:
            shown = f"{lever:.3g} {'times the radius' if radius > 0.0 else 'm'}"
            why = f"torque over load is {shown}: one of them is something else"
            found |= dict.fromkeys(("torque", "load"), why)
    if load > 0.0 and sizes.get("drawbar_pull", 0.0) > _MOST_PULL * load:
        why = f"the pull is {sizes['drawbar_pull'] / load:.3g} times this load"
        found |= dict.fromkeys(("drawbar_pull", "load"), why)
    most = radius if radius > 0.0 else _ANY_SINKAGE
    if sizes.get("sinkage", 0.0) > most and "sinkage" not in inputs.tare:
        found["sinkage"] = f"{sizes['sinkage']:.3g} m is no sinkage of a wheel"
    return found
