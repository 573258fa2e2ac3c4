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
from soilml.log_import.checks.row_checks import TRACTION, hints_of
from soilml.log_import.checks.slip_checks import FASTEST, RowsToCheck, other_units
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.draft import (
    Draft,
    correlation,
    driving_means,
    implied_radius,
    travel_over_rotation,
    wheel_of,
)
from soilml.log_import.guesses.role_words import MOST_FRACTION, USUAL, says, says_role, wheel_word
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

    def weigh(self, drafts: Mapping[str, Draft], inputs: Inputs | None) -> None:
        """Weigh the evidence for each channel of a wheel; those without are marked.

        inputs: Samples as the drafts read them; None where they cannot be read.
        """
        used = {draft.column.address for draft in drafts.values()}
        for draft in drafts.values():
            self._weigh_alone(draft, used)
        if inputs is not None:
            means = driving_means(inputs)
            marked = {role for role, why in self.shown.items() if isinstance(why, Marked)}
            marked |= {role for role, draft in drafts.items() if draft.is_marked}
            implied = implied_radius(drafts, means)
            for roles, why in self._doubts(drafts, means, implied):
                # what a channel that is marked already explains is doubted no more
                for role in roles if marked.isdisjoint(roles) else ():
                    drafts[role].against = drafts[role].against or why
            for role, why in (
                *self._by_speeds(drafts, travel_over_rotation(means)),
                *self._by_load(drafts, means, self._radius(implied)),
                *_by_behaviour(drafts, means),
            ):
                drafts[role].physics = drafts[role].physics or why
            never_rests = self.over_time and inputs.speed is not None and not inputs.rest
            for role in (role for role in drafts if USUAL[role].zero and never_rests):
                why = "the wheel never rests in the log, so that nothing shows where its zero is"
                drafts[role].against = drafts[role].against or why
        for draft in drafts.values():
            said = draft.comments.get("column", "")
            if not draft.is_silent and not isinstance(said, Marked):
                draft.comments["column"] = Marked(f"{draft.mark}; {said}" if said else draft.mark)

    def _weigh_alone(self, draft: Draft, used: set[str]) -> None:
        """What name, unit and values of a column alone say."""
        own, role = draft.column, draft.role
        others = self.seconds.get(role, ())
        alike = [c for c in self.columns if c.kind == UNITS[role] and not c.constant]
        left = [c.address for c in (*others, *alike) if c.address not in used]
        draft.word = says_role(role, own.name) or says_role(role, own.address)
        draft.rival, draft.second = _rival(role, own, others), left[0] if left else ""
        if role in self.shown and not isinstance(self.shown[role], Marked) and draft.stated_unit:
            draft.physics = self.shown[role]
        if says(own.name, "whole") and USUAL[role].per_wheel:
            draft.against = "its name is of a whole: a wheel has a share of what a rover has"
        if own.constant and role not in _SET:
            draft.against = f"it reads {own.middle:.3g} throughout"

    def _doubts(
        self, drafts: Mapping[str, Draft], means: Mapping[str, Floats], implied: float
    ) -> Iterator[tuple[list[str], str]]:
        """What the checks of rows say against channels, where seconds of driving are the rows."""
        wheel = wheel_of(drafts, self.radius or (implied if implied > 0.0 else None))
        rows = Conversion(wheel, None).of(means)
        radius = self._radius(implied) or None
        for hint in hints_of(RowsToCheck(rows, radius, wheel, self.weight)):
            yield [role for role in hint.about if role in drafts], hint.text

    def _radius(self, implied: float) -> float:
        """The radius as stated, else the largest travel over rotation; 0 where no wheel has it."""
        return self.radius or (implied if _RADII[0] < implied < _RADII[1] else 0.0)

    def _by_speeds(self, drafts: Mapping[str, Draft], ratio: Floats) -> Iterator[tuple[str, str]]:
        """Roles that travel over rotation (n,) confirms, and how."""
        turning = next((r for r in ROTATIONS if r in drafts), "")
        travel = next((r for r in TRAVELS if r in drafts), "")
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

            one_unit = _only_unit(drafts[turning], lambda x: fits(1.0 / x))
            one_unit = one_unit and _only_unit(drafts[travel], fits)
            if _SLIPS[0] < slips[0] and slips[1] < _SLIPS[1] and one_unit:
                yield from ((role, f"slip is {slips[0]:.2g} to {slips[1]:.2g}") for role in both)
        elif _RADII[0] < high < _RADII[1] and all(drafts[role].stated_unit for role in both):
            why = f"travel over rotation is {high:.2g} m, as of a wheel"
            yield from ((role, why) for role in both)

    def _by_load(
        self, drafts: Mapping[str, Draft], means: Mapping[str, Floats], radius: float
    ) -> Iterator[tuple[str, str]]:
        """Whether a stated mass confirms the load, and it and the torque each other."""
        size = float(np.nanmedian(np.abs(means["load"]))) if "load" in means else 0.0
        if size and self.weight and _OF_MASS[0] < size / self.weight[1] < _OF_MASS[1]:
            yield "load", f"the stated mass gives {self.weight[1]:.3g} N, and it shows {size:.3g} N"
        if not size or "torque" not in means or "torque" not in drafts:
            return
        lever = float(np.nanmedian(np.abs(means["torque"]))) / size
        low, high = (r * radius for r in TRACTION) if radius else _USUAL_LEVER
        for role, other, power in (("torque", "load", 1), ("load", "torque", -1)):
            draft, known = drafts.get(role), other not in drafts or drafts[other].stated_unit
            if draft is None or not known or not low < lever < high:
                continue

            def fits(x: float, power: int = power) -> bool:
                return low < lever * x**power < high

            alone = draft.stated_unit and sum(c.kind == UNITS[role] for c in self.columns) == 1
            if (draft.word or alone) and _only_unit(draft, fits):
                yield role, f"torque over load is {lever:.2g} m, as of a wheel"


def _only_unit(draft: Draft, fits: Callable[[float], bool]) -> bool:
    """Whether the unit is stated, or none of the others that loggers write fits as well."""
    others = other_units(draft.role, str(draft.keys.get("unit", "")))
    return bool(draft.stated_unit) or not any(map(fits, others.values()))


def _by_behaviour(
    drafts: Mapping[str, Draft], means: Mapping[str, Floats]
) -> Iterator[tuple[str, str]]:
    """Channels that vary together, and a slip of a size that only one unit gives."""
    for pair in _PAIRS:
        if abs(correlation(means, *pair)) > _TOGETHER:
            why = f"{' and '.join(pair).replace('_', ' ')} vary together"
            yield from ((r, why) for r in pair if r in drafts and drafts[r].stated_unit)
    if "slip" in means and "slip" in drafts and drafts["slip"].word:
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
