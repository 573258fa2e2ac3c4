"""The explanations of a case with their weights: [[explanation]], read and written.

What a gap analysis returns where no single explanation is the whole answer: models that share gear,
noise and remainder, each with its own effects and soil.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from soilml.config.model_settings import Effects, changed_soil, take_effects, take_priors
from soilml.errors import InputError
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.physics.effects import Effect
from soilml.physics.model import Model
from soilml.physics.soils import Soil

if TYPE_CHECKING:
    from soilml.config.case import Case

#: Sum of the weights above which they are no probabilities; a file has those of 95 %.
MOST_WEIGHT = 1.0 + 1e-6
MOST_EXPLANATIONS = 100


@dataclass(frozen=True)
class CaseExplanation:
    """One explanation: its probability, its model and its soil.

    Attributes
    ----------
    weight
        Probability of the explanation; those of a case add up to one at most.
    model, gears, soil
        As in `Case`: with the effects of the explanation, its sizes and its soil.
    prior
        Priors of its soil and of the sizes of its effects, by path.
    """

    weight: float
    model: Model
    soil: Soil
    gears: dict[str, Model] = field(default_factory=dict)
    prior: dict[str, Prior] = field(default_factory=dict)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of all its effects, those of the case included; of one gear `grousers@lugged`."""
        return tuple(_by_name(self.model, self.gears))

    @staticmethod
    def of(weight: float, case: Case) -> CaseExplanation:
        """A case as one explanation."""
        return CaseExplanation(weight, case.model, case.soil, dict(case.gears), dict(case.prior))


def with_suspects_explained(content: dict[str, Any]) -> dict[str, Any]:
    """The content of a model file whose effects with `suspected = true` are its only explanation.

    `gap` of earlier versions marked so what predicts and is not named; [[explanation]] says it now,
    and beside one the mark is refused as an unknown key.
    """
    if "explanation" in content:
        return content
    gears = content.get("gears")
    tables = {"": content, **(gears if isinstance(gears, dict) else {})}
    marked, left = [], dict(content)
    for gear, table in tables.items():
        entries = table.get("effect") if isinstance(table, dict) else None
        entries = entries if isinstance(entries, list) else []  # others are refused where read
        own = [e for e in entries if isinstance(e, dict) and e.get("suspected") is True]
        if not own:
            continue
        marked += [{k: v for k, v in e.items() if k != "suspected"} | {"gear": gear} for e in own]
        kept = dict(table) | {"effect": [e for e in entries if e not in own]}
        left = kept if not gear else left | {"gears": left["gears"] | {gear: kept}}
    return left | {"explanation": [{"weight": 1.0, "effect": marked}]} if marked else content


def take_explanations(settings: Settings, effects: Effects, base: Case) -> Case:
    """A case with what its tables [[explanation]] say.

    Raises `InputError` for a weight outside 0 to 1, weights that add up to more than one, and what
    [soil], [soil.prior] and [[effect]] refuse.
    """
    entries = settings.tables("explanation")
    if len(entries) > MOST_EXPLANATIONS:
        entries[0].fail(f"{len(entries)} explanations; at most {MOST_EXPLANATIONS} are possible")
    found = tuple(_take(entry, effects, base) for entry in entries)
    if entries and sum(one.weight for one in found) > MOST_WEIGHT:
        entries[0].fail("the weights of all [[explanation]] add up to more than 1")
    return replace(base, explanations=found)


def _take(entry: Settings, effects: Effects, base: Case) -> CaseExplanation:
    weight = entry.number("weight")
    if not (math.isfinite(weight) and 0.0 < weight <= 1.0):
        entry.fail(f"weight is {weight:g}; needed is a probability above 0, at most 1")
    soil = changed_soil(entry.table("soil"), base.soil)
    prior = base.prior | take_priors(entry.table("prior"), Soil)
    model, gears = base.model, dict(base.gears)
    for effect in entry.tables("effect"):
        gear = effect.text("gear", "")
        if gear and gear not in gears:
            effect.fail(f"gear is {gear!r}; there are: {', '.join(gears) or 'none with a name'}")
        before = gears[gear] if gear else model
        added, priors = take_effects([effect], effects, Model(before.gear))
        (new,) = added.effects
        others = (own for own in before.effects if own.name != new.name)
        after = replace(before, effects=(*others, new))
        if gear:
            gears[gear] = after
        else:
            model = after
        head = f"{new.name}@{gear}" if gear else new.name
        prior = {p: v for p, v in prior.items() if p.partition(".")[0] != head}
        prior |= {f"{head}.{path.partition('.')[2]}": v for path, v in priors.items()}
    entry.finish()
    return CaseExplanation(weight, model, soil, gears, prior)


def _by_name(model: Model, gears: Mapping[str, Model]) -> dict[str, Effect]:
    own = {effect.name: effect for effect in model.effects}
    return own | {f"{e.name}@{gear}": e for gear, m in gears.items() for e in m.effects}


def added_effects(base: Case, one: CaseExplanation) -> dict[str, Effect]:
    """Effects of an explanation that the case lacks, or has with other values, by name."""
    known = _by_name(base.model, base.gears)
    return {n: e for n, e in _by_name(one.model, one.gears).items() if known.get(n) != e}


def one_of(case: Case, what: str) -> Case:
    """The case of its only explanation, or the case as it is where it has none.

    Raises `InputError`, beginning with the file that it is of, where there are several.
    """
    if not case.explanations:
        return case
    if len(case.explanations) > 1:
        names = [" + ".join(e.effects) or "the soil alone" for e in case.explanations[:3]]
        raise InputError(
            f"{what} has {len(case.explanations)} explanations ({', '.join(names)}, ...); this "
            "command needs one model: keep one [[explanation]]"
        )
    return case.of_explanation(case.explanations[0])


def likeliest_with_effects(case: Case) -> Case:
    """The likeliest explanation that adds an effect; the case as it is where none does."""
    adding = [one for one in case.explanations if added_effects(case, one)]
    if not adding:
        return replace(case, explanations=())
    return case.of_explanation(max(adding, key=lambda one: one.weight))
