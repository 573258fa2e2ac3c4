"""The effects that an analysis of one or several gears may find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import SIZE_TOLERANCE
from soilml.physics.effects.base import Effect


def candidate_effects(case: Case, effects: Mapping[str, type[Effect]]) -> dict[str, type[Effect]]:
    """The effects that suit the gears of a case, by name.

    With several gears, an effect of soil, rig or sensor, and any effect that suits all gears, is
    one that they share; an effect whose cause is in the gear is offered for each gear alone too,
    as `grousers@lugged`. Of a family of which the case has an effect, no other is offered.
    """
    models = (case.model, *case.gears.values())
    own = {e.name: e.about.family for model in models for e in model.effects}
    taken = set(own.values()) - {""}
    effects = {n: e for n, e in effects.items() if n in own or e.about.family not in taken}
    if not case.gears:
        return {name: e for name, e in effects.items() if e.applies_to(case.model.gear)}
    found = {}
    for name, effect in effects.items():
        suited = [gear for gear, model in case.gears.items() if effect.applies_to(model.gear)]
        if len(suited) == len(case.gears):
            found[name] = effect
        if effect.about.kind == "wheel" and len(case.gears) > 1:
            base: type = effect
            found |= {f"{name}@{gear}": _effect_of_gear(base, gear) for gear in suited}
    return found


@cache
def _effect_of_gear(effect: Any, gear: str) -> type[Effect]:
    """The effect under the name that it has where it acts on one of several gears."""
    of_gear: type[Effect] = type(effect.__name__, (effect,), {"name": f"{effect.name}@{gear}"})
    return of_gear


def with_effect(case: Case, effect: type[Effect]) -> Case:
    """The case with an effect added at its neutral size, or unchanged if it has the effect.

    An effect of one gear starts from the shared effect that it replaces, where there is one.
    """
    name, _, gear = effect.name.partition("@")
    model = case.gears[gear] if gear else case.model
    if any(own.name == name for own in model.effects):
        return case
    shared = [own for own in case.model.effects if own.name == name]
    base: Any = effect.__base__ if gear else effect
    changed = model + (shared[0] if shared else base())
    if gear:
        return replace(case, gears={**case.gears, gear: changed})
    return replace(case, model=changed)


def effect_names(case: Case) -> list[str]:
    """Names of the effects of a case, those of one of several gears as `grousers@lugged`."""
    own = [f"{e.name}@{gear}" for gear, model in case.gears.items() for e in model.effects]
    return [*(effect.name for effect in case.model.effects), *own]


def gears_differ(case: Case, dimension: str) -> bool:
    """Whether a case has gears that differ in this dimension by more than their tolerance."""
    sizes = [float(getattr(m.gear, dimension, np.nan)) for m in case.gears.values()]
    return bool(sizes) and np.nanmax(sizes) > (1.0 + SIZE_TOLERANCE) * np.nanmin(sizes)
