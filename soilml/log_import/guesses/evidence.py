"""What speaks for each guessed channel: a guess without evidence is marked in the map.

A channel stands without a mark where its unit is stated and a full word of its role is in its
name, or where another channel confirms it. The others are marked, with the second-best column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.checks.checked_rows import RowsToCheck, other_units
from soilml.log_import.checks.row_hints import TRACTION, hints_of
from soilml.log_import.checks.slip_hints import FASTEST
from soilml.log_import.guesses.columns import Candidate, says_role, wheel_word
from soilml.log_import.guesses.draft import (
    Draft,
    driving_means,
    implied_radius,
    travel_over_rotation,
    wheel_of,
)
from soilml.log_import.mapping.channel_map import ROTATIONS, TRAVELS, UNITS
from soilml.log_import.mapping.written_map import Marked

_USUAL_LEVER = (0.004, 0.25)  # T / W of wheels on soil, m, where no radius is known
#: Travel over rotation of wheels, m; slips of a driven wheel, 5th to 95th percentile.
_RADII, _SLIPS = (0.02, 0.6), (-0.3, 0.97)
_TOGETHER, _FEWEST = 0.8, 6  # Correlation that confirms, and fewest means that tell it
_OF_MASS = (0.5, 2.0)  # Load over its share of the stated mass
_SAME_SIZE = 0.95  # Ratio of the sizes of two columns that may hold the same
_ADDED = ("load", "drawbar_pull")  # Roles of which two equal columns may be parts of one
_WITH_A_ZERO = ("torque", "motor_current", "drawbar_pull")  # Roles that read zero at rest
_SET = ("load", "slip", "slope")  # Roles that a rig may keep at one value
#: Largest fraction that a column of slip may hold, and the least one of per cent: (r omega - v)/v
#: lies between, and above 30 it were a slip of 0.97.
MOST_FRACTION, LEAST_PERCENT, _SURELY_PERCENT = 1.0, 5.0, 30.0
BY_NAME = "by its name"  # Why a unit is known that no brackets state, as of ticks and rpm
_PAIRS = (("torque", "drawbar_pull"), ("motor_current", "drawbar_pull"), ("torque", "slip"),
          ("sinkage", "slip"), ("sinkage", "torque"), ("motor_current", "torque"))  # fmt: skip
_OF_NO_MAP = ("odd-row", "constant-reading")  # Hints that doubt rows and sensors


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
    radius: float,
    weight: tuple[float, float] | None,
    seconds: Mapping[str, Sequence[Candidate]],
    columns: Sequence[Candidate],
    shown: Mapping[str, str],
    over_time: bool = True,
) -> list[GuessEvidence]:
    """The evidence for each channel of a wheel that is a column; those without are marked.

    inputs: Samples as the drafts read them; None where they cannot be read.
    radius: As stated, m; 0 where it is not.
    weight: Least and largest weight on each wheel by the stated mass, N; None without one.
    seconds: The next columns by role.
    shown: What the behaviour of several alike columns has shown, by role.
    over_time: Whether a wheel that rests would be seen; not in rows that are steady runs.
    """
    used = {draft.column.address for draft in drafts.values()}
    found = {}
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
        if own.about.constant and role not in _SET:
            found[role].against = f"it reads {own.about.middle:.3g} throughout"
    if inputs is not None:
        means = driving_means(inputs)
        marked = {role for role, why in shown.items() if isinstance(why, Marked)}
        marked |= {role for role, draft in drafts.items() if draft.is_marked}
        for roles, why in _doubts(drafts, means, radius, weight):
            # what a channel that is marked already explains is doubted no more
            for role in roles if marked.isdisjoint(roles) else ():
                found[role].against = found[role].against or why
        for role, why in _confirmed(found, drafts, means, radius, weight, columns):
            if role in found and not found[role].physics:
                found[role].physics = why
        never_rests = over_time and inputs.speed is not None and not inputs.rest
        for role in {*_WITH_A_ZERO} & found.keys() if never_rests else ():
            why = "the wheel never rests in the log, so that nothing shows where its zero is"
            found[role].against = found[role].against or why
    for role, one in found.items():
        comments = drafts[role].comments
        said = comments.get("column", "")
        if not one.silent and not isinstance(said, Marked):
            comments["column"] = Marked(f"{one.mark}; {said}" if said else one.mark)
    return list(found.values())


def _rival(role: str, own: Candidate, others: Sequence[Candidate]) -> str:
    """A column of other values whose name fits a role as well; "" for none, as of other wheels.

    Of forces that may add up, equal ones are two sensors, or the same one twice.
    """
    for other in others:
        same = other.kind == own.kind and other.scores.get(role, 0.0) >= own.scores[role]
        sizes = sorted((own.about.size, other.about.size))
        other_values = role in _ADDED or sizes[0] < _SAME_SIZE * sizes[1]
        if same and other_values and not wheel_word(other.address):
            return other.address
    return ""


def _doubts(
    drafts: Mapping[str, Draft],
    means: Mapping[str, Floats],
    radius: float,
    weight: tuple[float, float] | None,
) -> Iterator[tuple[list[str], str]]:
    """What the checks of rows say against channels, where seconds of driving are the rows.

    Where no radius is stated, it is the largest travel over rotation.
    """
    implied = implied_radius(drafts, means)
    of_wheel = radius or (implied if _RADII[0] < implied < _RADII[1] else 0.0)
    known = radius or (implied if implied > 0.0 else None)
    wheel = wheel_of(drafts, known)
    rows = Conversion(wheel, None).of(means)
    for hint in hints_of(RowsToCheck(rows, of_wheel or None, wheel, weight)):
        roles = [role for role in hint.about if role in drafts]
        if hint.code not in _OF_NO_MAP:
            yield roles, hint.text


def _confirmed(
    found: Mapping[str, GuessEvidence],
    drafts: Mapping[str, Draft],
    means: Mapping[str, Floats],
    radius: float,
    weight: tuple[float, float] | None,
    columns: Sequence[Candidate],
) -> Iterator[tuple[str, str]]:
    """Roles that another channel confirms, and how.

    A unit that is not stated is confirmed where none of those that loggers write fits as well.
    """

    def only_unit(role: str, fits: Callable[[float], bool]) -> bool:
        others = other_units(role, str(drafts[role].keys.get("unit", "")))
        return bool(found[role].unit) or not any(map(fits, others.values()))

    turning = next((r for r in ROTATIONS if r in found), "")
    travel = next((r for r in TRAVELS if r in found), "")
    ratio = travel_over_rotation(means)
    ratio = ratio[np.isfinite(ratio)]
    # the ratio of two measurements has some scatter
    if turning and travel and ratio.size and (ratio.size < 3 or np.ptp(ratio) > 1e-9 * ratio.max()):
        ratio = float(drafts[turning].keys.get("gear_ratio", 1.0)) * ratio
        radius_here = 1.0 if turning == "rim_speed" else radius
        low, high = (float(x) for x in np.percentile(ratio, [5, 95]))
        slips = (1.0 - high / radius_here, 1.0 - low / radius_here) if radius_here else (9, 9)

        def fits(size: float) -> bool:
            return FASTEST[0] < high / radius_here * size < FASTEST[1]

        usual = _SLIPS[0] < slips[0] and slips[1] < _SLIPS[1]
        if usual and only_unit(turning, lambda size: fits(1 / size)) and only_unit(travel, fits):
            why = f"slip is {slips[0]:.2g} to {slips[1]:.2g}"
            yield from ((role, why) for role in (turning, travel))
        of_wheel = _RADII[0] < high < _RADII[1]
        if found[turning].unit and found[travel].unit and not radius and of_wheel:
            why = f"travel over rotation is {high:.2g} m, as of a wheel"
            yield from ((role, why) for role in (turning, travel))
        radius = radius or (high if of_wheel else 0.0)
    size = float(np.nanmedian(np.abs(means["load"]))) if "load" in means else 0.0
    if size and weight and _OF_MASS[0] < size / weight[1] < _OF_MASS[1]:
        yield "load", f"the stated mass gives {weight[1]:.3g} N, and it shows {size:.3g} N"
    if size and "torque" in means and "torque" in found:
        lever = float(np.nanmedian(np.abs(means["torque"]))) / size
        low, high = (r * radius for r in TRACTION) if radius else _USUAL_LEVER
        why = f"torque over load is {lever:.2g} m, as of a wheel"
        for role, other, power in (("torque", "load", 1), ("load", "torque", -1)):
            if not low < lever < high or role not in found:
                continue
            alone = bool(found[role].unit) and sum(c.kind == UNITS[role] for c in columns) == 1
            if (other in found and not found[other].unit) or not (found[role].word or alone):
                continue
            if only_unit(role, partial(_between, low / lever, high / lever, power)):
                yield role, why
    for pair in _PAIRS:
        if _correlation(means, *pair) > _TOGETHER:
            why = f"{' and '.join(pair).replace('_', ' ')} vary together"
            yield from ((r, why) for r in pair if r in found and found[r].unit)
    if "slip" in means and "slip" in found and found["slip"].word:
        low, high = float(np.nanmin(means["slip"])), float(np.nanmax(means["slip"]))
        given = 100.0 * high if drafts["slip"].keys.get("unit") == "%" else high
        known = 0.02 < given <= MOST_FRACTION or given >= _SURELY_PERCENT
        if low >= -1.0 and high <= 1.0 and known and not drafts["slip"].is_marked:
            yield "slip", f"it lies between {low:.2g} and {high:.2g}"


def _between(low: float, high: float, power: int, size: float) -> bool:
    return low < size**power < high


def _correlation(means: Mapping[str, Floats], one: str, other: str) -> float:
    """Correlation of two channels, without sign; 0 where too few means tell it."""
    if not {one, other} <= means.keys():
        return 0.0
    both = np.stack([means[one], means[other]])
    both = both[:, np.isfinite(both).all(axis=0)]
    if both.shape[1] < _FEWEST or not np.ptp(both, axis=1).all():
        return 0.0
    return abs(float(np.corrcoef(*both)[0, 1]))
