"""What speaks for each guessed channel: a guess without evidence is marked in the map.

A channel stands without a mark where its unit is stated and a full word of its role is in its
name, or where another channel confirms it. The others are marked, with the second-best column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.checks.checked_rows import RowsToCheck, other_units
from soilml.log_import.checks.row_hints import TRACTION, hints_of
from soilml.log_import.checks.slip_hints import FASTEST
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.draft import (
    Draft,
    correlation,
    driving_means,
    implied_radius,
    travel_over_rotation,
    wheel_of,
)
from soilml.log_import.guesses.role_words import MOST_FRACTION, USUAL, says_role, wheel_word
from soilml.log_import.mapping.channel_map import ROTATIONS, TRAVELS, UNITS
from soilml.log_import.mapping.written_map import Marked

_USUAL_LEVER = (0.004, 0.25)  # T / W of wheels on soil, m, where no radius is known
#: Travel over rotation of wheels, m; slips of a driven wheel, 5th to 95th percentile.
_RADII, _SLIPS = (0.02, 0.6), (-0.3, 0.97)
_TOGETHER = 0.8  # Correlation that confirms
_OF_MASS = (0.5, 2.0)  # Load over its share of the stated mass
_SAME_SIZE = 0.95  # Ratio of the sizes of two columns that may hold the same
_ADDED = ("load", "drawbar_pull")  # Roles of which two equal columns may be parts of one
_SET = ("load", "slip", "slope")  # Roles that a rig may keep at one value
_SURELY_PERCENT = 30.0  # As (r omega - v)/v in fractions, a slip of 0.97
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


@dataclass(frozen=True)
class Judge:
    """What is known of a wheel beside its channels.

    radius: As stated, m; 0 where it is not.
    weight: Least and largest weight on each wheel by the stated mass, N; None without one.
    seconds: The next columns by role.
    columns: All columns that may be channels.
    shown: What the behaviour of several alike columns has shown, by role.
    over_time: Whether a wheel that rests would be seen; not in rows that are steady runs.
    """

    radius: float
    weight: tuple[float, float] | None
    seconds: Mapping[str, Sequence[Candidate]]
    columns: Sequence[Candidate]
    shown: Mapping[str, str]
    over_time: bool

    def weigh(self, drafts: Mapping[str, Draft], inputs: Inputs | None) -> list[GuessEvidence]:
        """The evidence for each channel of a wheel; those without are marked in their drafts.

        inputs: Samples as the drafts read them; None where they cannot be read.
        """
        used = {draft.column.address for draft in drafts.values()}
        found = {role: self._stated(role, draft, used) for role, draft in drafts.items()}
        if inputs is not None:
            means = driving_means(inputs)
            marked = {role for role, why in self.shown.items() if isinstance(why, Marked)}
            marked |= {role for role, draft in drafts.items() if draft.is_marked}
            implied = implied_radius(drafts, means)
            for roles, why in self._doubts(drafts, means, implied):
                # what a channel that is marked already explains is doubted no more
                for role in roles if marked.isdisjoint(roles) else ():
                    found[role].against = found[role].against or why
            for role, why in (
                *self._by_speeds(found, drafts, travel_over_rotation(means)),
                *self._by_load(found, drafts, means, self._radius(implied)),
                *_by_behaviour(found, drafts, means),
            ):
                found[role].physics = found[role].physics or why
            never_rests = self.over_time and inputs.speed is not None and not inputs.rest
            for role in (role for role in found if USUAL[role].zero and never_rests):
                why = "the wheel never rests in the log, so that nothing shows where its zero is"
                found[role].against = found[role].against or why
        for role, one in found.items():
            comments = drafts[role].comments
            said = comments.get("column", "")
            if not one.silent and not isinstance(said, Marked):
                comments["column"] = Marked(f"{one.mark}; {said}" if said else one.mark)
        return list(found.values())

    def _stated(self, role: str, draft: Draft, used: set[str]) -> GuessEvidence:
        """What name, unit and values of a column alone say."""
        own, others = draft.column, self.seconds.get(role, ())
        alike = [c for c in self.columns if c.kind == UNITS[role] and not c.constant]
        left = [c.address for c in (*others, *alike) if c.address not in used]
        named = says_role(role, own.name) or says_role(role, own.address)
        second = left[0] if left else ""
        found = GuessEvidence(
            role, own.address, draft.stated_unit, named, _rival(role, own, others), second
        )
        if role in self.shown and not isinstance(self.shown[role], Marked) and found.unit:
            found.physics = self.shown[role]
        if own.constant and role not in _SET:
            found.against = f"it reads {own.middle:.3g} throughout"
        return found

    def _doubts(
        self, drafts: Mapping[str, Draft], means: Mapping[str, Floats], implied: float
    ) -> Iterator[tuple[list[str], str]]:
        """What the checks of rows say against channels, where seconds of driving are the rows."""
        wheel = wheel_of(drafts, self.radius or (implied if implied > 0.0 else None))
        rows = Conversion(wheel, None).of(means)
        radius = self._radius(implied) or None
        for hint in hints_of(RowsToCheck(rows, radius, wheel, self.weight)):
            if hint.code not in _OF_NO_MAP:
                yield [role for role in hint.about if role in drafts], hint.text

    def _radius(self, implied: float) -> float:
        """The radius as stated, else the largest travel over rotation; 0 where no wheel has it."""
        return self.radius or (implied if _RADII[0] < implied < _RADII[1] else 0.0)

    def _by_speeds(
        self, found: Mapping[str, GuessEvidence], drafts: Mapping[str, Draft], ratio: Floats
    ) -> Iterator[tuple[str, str]]:
        """Roles that travel over rotation (n,) confirms, and how."""
        turning = next((r for r in ROTATIONS if r in found), "")
        travel = next((r for r in TRAVELS if r in found), "")
        # the ratio of two measurements has some scatter
        scatters = ratio.size and (ratio.size < 3 or np.ptp(ratio) > 1e-9 * ratio.max())
        if not (turning and travel and scatters):
            return
        both = (turning, travel)
        low, high = (float(x) for x in np.percentile(drafts[turning].gear_ratio * ratio, [5, 95]))
        radius = 1.0 if turning == "rim_speed" else self.radius
        if radius:
            slips = 1.0 - high / radius, 1.0 - low / radius

            def fits(size: float) -> bool:
                return FASTEST[0] < high / radius * size < FASTEST[1]

            one_unit = _only_unit(found[turning], drafts, lambda x: fits(1.0 / x))
            one_unit = one_unit and _only_unit(found[travel], drafts, fits)
            if _SLIPS[0] < slips[0] and slips[1] < _SLIPS[1] and one_unit:
                yield from ((role, f"slip is {slips[0]:.2g} to {slips[1]:.2g}") for role in both)
        elif _RADII[0] < high < _RADII[1] and all(found[role].unit for role in both):
            why = f"travel over rotation is {high:.2g} m, as of a wheel"
            yield from ((role, why) for role in both)

    def _by_load(
        self,
        found: Mapping[str, GuessEvidence],
        drafts: Mapping[str, Draft],
        means: Mapping[str, Floats],
        radius: float,
    ) -> Iterator[tuple[str, str]]:
        """Whether a stated mass confirms the load, and it and the torque each other."""
        size = float(np.nanmedian(np.abs(means["load"]))) if "load" in means else 0.0
        if size and self.weight and _OF_MASS[0] < size / self.weight[1] < _OF_MASS[1]:
            yield "load", f"the stated mass gives {self.weight[1]:.3g} N, and it shows {size:.3g} N"
        if not size or "torque" not in means or "torque" not in found:
            return
        lever = float(np.nanmedian(np.abs(means["torque"]))) / size
        low, high = (r * radius for r in TRACTION) if radius else _USUAL_LEVER
        for role, other, power in (("torque", "load", 1), ("load", "torque", -1)):

            def fits(x: float, power: int = power) -> bool:
                return low < lever * x**power < high

            if role not in found or not fits(1.0) or (other in found and not found[other].unit):
                continue
            alone = found[role].unit and sum(c.kind == UNITS[role] for c in self.columns) == 1
            if (found[role].word or alone) and _only_unit(found[role], drafts, fits):
                yield role, f"torque over load is {lever:.2g} m, as of a wheel"


def _only_unit(
    one: GuessEvidence, drafts: Mapping[str, Draft], fits: Callable[[float], bool]
) -> bool:
    """Whether the unit is stated, or none of the others that loggers write fits as well."""
    others = other_units(one.role, str(drafts[one.role].keys.get("unit", "")))
    return bool(one.unit) or not any(map(fits, others.values()))


def _by_behaviour(
    found: Mapping[str, GuessEvidence], drafts: Mapping[str, Draft], means: Mapping[str, Floats]
) -> Iterator[tuple[str, str]]:
    """Channels that vary together, and a slip of a size that only one unit gives."""
    for pair in _PAIRS:
        if abs(correlation(means, *pair)) > _TOGETHER:
            why = f"{' and '.join(pair).replace('_', ' ')} vary together"
            yield from ((r, why) for r in pair if r in found and found[r].unit)
    if "slip" in means and "slip" in found and found["slip"].word:
        low, high = float(np.nanmin(means["slip"])), float(np.nanmax(means["slip"]))
        given = 100.0 * high if drafts["slip"].keys.get("unit") == "%" else high
        known = 0.02 < given <= MOST_FRACTION or given >= _SURELY_PERCENT
        if low >= -1.0 and high <= 1.0 and known and not drafts["slip"].is_marked:
            yield "slip", f"it lies between {low:.2g} and {high:.2g}"


def _rival(role: str, own: Candidate, others: Sequence[Candidate]) -> str:
    """A column of other values whose name fits a role as well; "" for none, as of other wheels.

    Of forces that may add up, equal ones are two sensors, or the same one twice.
    """
    for other in others:
        same = other.kind == own.kind and other.score(role) >= own.score(role)
        sizes = sorted((own.size, other.size))
        other_values = role in _ADDED or sizes[0] < _SAME_SIZE * sizes[1]
        if same and other_values and not wheel_word(other.address):
            return other.address
    return ""
