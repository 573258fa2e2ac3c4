"""Changes at each stage of a model that no effect of a catalogue names, and their signatures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any

from soilml.arrays import Floats, Real
from soilml.config.case import Case
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.readings import Readings
from soilml.parameters import Parameter
from soilml.physics.contact import with_normal
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.load_case import LoadCase

#: Stages of a model.
GEOMETRY, NORMAL, SHEAR = "contact geometry", "normal stress", "shear stress"
OPERATING = "slip or load"
#: Name, stage and method of each change, a small size, and what it does to a value by a size.
_CHANGES: list[tuple[str, str, str, float, Callable[[Any, LoadCase, Real], Any]]] = [
    ("change-normal", NORMAL, "on_stress", 0.1,
     lambda stress, at, size: with_normal(stress, stress.normal * (1.0 + size), at.soil)),
    ("change-shear", SHEAR, "on_stress", 0.1,
     lambda stress, _, size: replace(stress, shear=stress.shear * (1.0 + size))),
    ("change-entry", GEOMETRY, "on_contact", 0.1,
     lambda rim, _, size: replace(
         rim, entry=rim.entry * (1.0 + size), peak=rim.peak * (1.0 + size))),
    ("change-exit", GEOMETRY, "on_contact", 0.2,
     lambda rim, _, size: replace(rim, exit=rim.exit - size * rim.entry)),
    ("change-peak", GEOMETRY, "on_contact", 0.1,
     lambda rim, _, size: replace(rim, peak=rim.peak + size * rim.entry)),
    ("change-lever", GEOMETRY, "on_contact", 0.05,
     lambda rim, _, size: replace(
         rim, shear_radius=rim.shear_radius + size * rim.radius,
         lever=rim.lever + size * rim.radius)),
    ("change-slip", OPERATING, "on_operating", 0.02,
     lambda at, _, size: replace(at, slip=at.slip + size)),
    ("change-load", OPERATING, "on_operating", 0.05,
     lambda at, _, size: replace(at, load=at.load * (1.0 + size))),
]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class StageChange(Effect):
    """A change at one stage, by a size."""

    size: Annotated[Real, Parameter("1", -10.0, 10.0, "relative size of the change")] = 0.0


def _effect(
    name: str,
    stage: str,
    method: str,
    reference: float,
    apply: Callable[[Any, LoadCase, Real], Any],
) -> type[Effect]:
    """An effect that applies a function at one stage; its reference size is a small change."""

    def act(self: StageChange, value: Any, load_case: LoadCase) -> Any:
        return apply(value, load_case, self.size)

    about = EffectCard(
        text="a change at one stage of a model",
        source="none: it stands for all laws that act there",
        kind="soil",
        reference={"size": reference},
        signs={},
        isolate="",
    )
    gear_types = (RigidWheel,) if stage == GEOMETRY else ()
    own = {"name": name, "about": about, method: act, "gear_types": gear_types}
    return type("StageChange", (StageChange,), own)


_EFFECTS = {
    name: (stage, _effect(name, stage, method, reference, apply))
    for name, stage, method, reference, apply in _CHANGES
}


def stage_changes(case: Case, readings: Readings) -> list[tuple[str, Floats]]:
    """Stage of each change that the gears of a case can have, and what it does to readings (m,).

    Changes without an equilibrium, or without influence, are left out.
    """
    gears = [model.gear for model in (case.model, *case.gears.values())]
    effects = {name: own for name, (_, own) in _EFFECTS.items() if all(map(own.applies_to, gears))}
    return [(_EFFECTS[s.name][0], s.column) for s in effect_signatures(case, readings, effects)[0]]
