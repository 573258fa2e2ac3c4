"""What speaks for each guessed channel: a guess without evidence is marked in the map.

A channel stands without a mark where its unit is stated and a full word of its role is in its
name, or where another channel confirms it. The others are marked, with the second-best column.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
#: T / (W r) of wheels on soil: outside of it by a factor of 10, a unit is another one.
_TRACTION = (0.02, 1.2)
_USUAL_LEVER = (0.004, 0.25)  # The same in m, where no radius is known
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
    """What speaks for a column in a role.

    unit: The stated unit; "" where it was guessed.
    word: Whether a full word of the role is in the name.
    physics, against: What other channels say for it and against it.
    rival: A column of other values whose name says as much; "" for none.
    second: The column that would be the next one; "" for none.
    """

    role: str
    column: str
    unit: str
    word: bool
    physics: str = ""
    against: str = ""
    rival: str = ""
    second: str = ""

    @property
    def silent(self) -> bool:
        """Whether the channel needs no mark: the one rule."""
        proved = bool((self.unit and self.word) or self.physics)
        return proved and not (self.against or self.rival)

    @property
    def mark(self) -> str:
        """What the mark says, and which column might be meant otherwise."""
        why = [self.against] if self.against else [
            *(["its name alone does not say so"] if not self.word else []),
            *(["no unit is stated"] if not self.unit else []),
        ]  # fmt: skip
        if not why:
            return f"CHANGE: {self.rival!r} fits as well"
        other = f"; else perhaps {self.second!r}" if self.second else ""
        return f"CHANGE: {', and '.join(why)}{other}"


def weigh(
    drafts: Mapping[str, Draft],
    inputs: Inputs | None,
    constants: Mapping[str, float],
    seconds: Mapping[str, Sequence[Candidate]],
    columns: Sequence[Candidate],
    shown: Mapping[str, str],
) -> list[GuessEvidence]:
    """The evidence for each channel of a wheel that is a column.

    inputs: Samples as the drafts read them; None where they cannot be read.
    constants: Stated `radius` (m), and `weight` (N) on each wheel with the `least_weight` that it
        may be where nothing says how many carry it, as far as they are known.
    seconds: The next columns by role.
    shown: What the behaviour of several alike columns has shown, by role.
    """
    found = {}
    for role, draft in drafts.items():
        if draft.column is None:
            continue
        own = draft.column
        stated = own.unit if own.kind not in (None, "other") else ""
        if draft.comments.get("unit") == BY_NAME:
            stated = str(draft.keys["unit"])
        word = says_role(role, own.name) or says_role(role, own.address)
        others = seconds.get(role, ())
        found[role] = GuessEvidence(
            role, own.address, stated, word, rival=_rival(role, own, others),
            second=_second(role, own, others, columns, drafts.values()),
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
    return list(found.values())


def _rival(role: str, own: Candidate, others: Sequence[Candidate]) -> str:
    """A column of other values whose name fits a role as well; "" for none, as of other wheels."""
    for other in others:
        same = other.kind == own.kind and other.scores.get(role, 0.0) >= own.scores[role]
        sizes = [c.about.size for c in (own, other)]
        if same and not wheel_word(other.address) and min(sizes) < _SAME_SIZE * max(sizes):
            return other.address
    return ""


def _second(
    role: str, own: Candidate, others: Sequence[Candidate], columns: Sequence[Candidate],
    drafts: Iterable[Draft],
) -> str:  # fmt: skip
    """The next column by name, else an unused one that varies and has the unit of the role."""
    used = {d.column.address for d in drafts if d.column is not None}
    alike = [c for c in columns if c.kind == UNITS[role] and not c.about.constant]
    left = [c.address for c in (*others, *alike) if c.address not in {own.address, *used}]
    return left[0] if left else ""


def mark(drafts: Mapping[str, Draft], evidence: Iterable[GuessEvidence]) -> None:
    """Mark the channels whose evidence does not suffice."""
    for one in evidence:
        comments = drafts[one.role].comments
        said = comments.get("column", "")
        if not one.silent and not isinstance(said, Marked):
            comments["column"] = Marked(f"{one.mark}; {said}" if said else one.mark)


def as_table(evidence: Iterable[GuessEvidence]) -> str:
    """The evidence as lines of text, one for each channel."""
    lines = []
    for e in evidence:
        lines.append(f"[{e.role}] {e.column}: {'no mark' if e.silent else e.mark}")
        lines.append(
            f"    unit {e.unit or 'not stated'}; "
            f"{'a' if e.word else 'no'} full word of the role in the name; "
            f"physics: {e.against or e.physics or 'nothing confirms it'}"
        )
    return "\n".join(lines) + "\n"


def _confirmed(
    found: Mapping[str, GuessEvidence],
    drafts: Mapping[str, Draft],
    inputs: Inputs,
    constants: Mapping[str, float],
    columns: Sequence[Candidate],
) -> Iterable[tuple[str, str]]:
    """Roles that another channel confirms, and how."""
    means, radius = driving_means(inputs), constants.get("radius", 0.0)
    rotation = [r for r in ("rim_speed", "wheel_speed", "wheel_angle") if r in found]
    travel = [r for r in ("ground_speed", "position") if r in found]
    ratio = travel_over_rotation(means)
    if rotation and travel and ratio.size:
        turning = rotation[0]
        gear = float(drafts[turning].keys.get("gear_ratio", 1.0))
        ratio = gear * ratio[np.isfinite(ratio)]
        radius_here = 1.0 if turning == "rim_speed" else radius
        if ratio.size and _travels_by_itself(ratio):
            low, high = (float(x) for x in np.percentile(ratio, [5, 95]))
            slips = (1.0 - high / radius_here, 1.0 - low / radius_here) if radius_here else (9, 9)
            if _SLIPS[0] < slips[0] and slips[1] < _SLIPS[1]:
                why = f"slip is {slips[0]:.2g} to {slips[1]:.2g}"
                yield from ((role, why) for role in (turning, travel[0]))
            stated = found[turning].unit and found[travel[0]].unit
            if stated and not radius and _RADII[0] < high < _RADII[1]:
                why = f"travel over rotation is {high:.2g} m, as of a wheel"
                yield from ((role, why) for role in (turning, travel[0]))
            radius = radius or (high if _RADII[0] < high < _RADII[1] else 0.0)
    load = means.get("load")
    size = float(np.nanmedian(np.abs(load))) if load is not None else 0.0
    weight = constants.get("weight", 0.0)
    if size and weight and _OF_MASS[0] < size / weight < _OF_MASS[1]:
        yield "load", f"the stated mass gives {weight:.3g} N, and it shows {size:.3g} N"
    together = _together(means)
    if size and "torque" in means:
        lever = float(np.nanmedian(np.abs(means["torque"]))) / size
        alone = {
            role: sum(c.kind == UNITS[role] for c in columns) == 1 for role in ("torque", "load")
        }
        low, high = (r * radius for r in _TRACTION) if radius else _USUAL_LEVER
        if low < lever < high:
            why = f"torque over load is {lever:.2g} m, as of a wheel"
            units = {role: role in found and found[role].unit for role in alone}
            for role, other in (("torque", "load"), ("load", "torque")):
                known = role in found and (found[role].word or (units[role] and alone[role]))
                if known and (units[other] or (other == "load" and other not in found)):
                    yield role, why
    for one, other in _PAIRS:
        if together.get((one, other), 0.0) > _TOGETHER:
            why = f"{one.replace('_', ' ')} and {other.replace('_', ' ')} vary together"
            yield from ((r, why) for r in (one, other) if r in found and found[r].unit)
    slip = means.get("slip")
    if slip is not None and "slip" in found and found["slip"].word:
        low, high = float(np.nanmin(slip)), float(np.nanmax(slip))
        given = 100.0 * high if drafts["slip"].keys.get("unit") == "%" else high
        known = 0.02 < given <= MOST_FRACTION or given >= LEAST_PERCENT
        if low >= -1.0 and high <= 1.0 and known and not drafts["slip"].is_marked:
            yield "slip", f"it lies between {low:.2g} and {high:.2g}"


def _travels_by_itself(ratio: Floats) -> bool:
    """Whether travel and rotation are two measurements: else their ratio has no scatter."""
    return ratio.size < 3 or float(np.ptp(ratio)) > 1e-9 * float(np.max(ratio))


def _together(means: Mapping[str, Floats]) -> dict[tuple[str, str], float]:
    """Correlations of the pairs that confirm each other."""
    found = {}
    for one, other in _PAIRS:
        if not {one, other} <= means.keys():
            continue
        good = np.isfinite(means[one]) & np.isfinite(means[other])
        a, b = means[one][good], means[other][good]
        if a.size >= _FEWEST and np.ptp(a) > 0.0 and np.ptp(b) > 0.0:
            together = np.asarray(np.corrcoef(a, b), dtype=np.float64)
            found[one, other] = abs(float(together[0, 1]))
    return found


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
            found["torque"] = f"torque over load is {shown}: one of them is something else"
            found["load"] = found["torque"]
    if load > 0.0 and sizes.get("drawbar_pull", 0.0) > _MOST_PULL * load:
        found["load"] = f"the pull is {sizes['drawbar_pull'] / load:.3g} times this load"
        found["drawbar_pull"] = found["load"]
    most = radius if radius > 0.0 else _ANY_SINKAGE
    if sizes.get("sinkage", 0.0) > most and "sinkage" not in inputs.tare:
        found["sinkage"] = f"{sizes['sinkage']:.3g} m is no sinkage of a wheel"
    return found
