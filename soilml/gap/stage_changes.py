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
from soilml.physics.contact import Stress, with_normal
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating

#: Stages of a model.
GEOMETRY, NORMAL, SHEAR = "contact geometry", "normal stress", "shear stress"
OPERATING = "slip or load"


@dataclass(frozen=True, kw_only=True)
class StageChange(Effect):
    """A change at one stage, by a size."""

    size: Annotated[Real, Parameter("1", -10.0, 10.0, "relative size of the change")] = 0.0


def stage_changes(case: Case, readings: Readings) -> list[tuple[str, Floats]]:
    """Stage of each change that the gears of a case can have, and what it does to readings (m,).

    Changes without an equilibrium, or without influence, are left out.
    """
    gears = [model.gear for model in (case.model, *case.gears.values())]
    suited = {e.name: (stage, e) for stage, e in _CHANGES if all(map(e.applies_to, gears))}
    effects = {name: effect for name, (_, effect) in suited.items()}
    return [(suited[s.name][0], s.column) for s in effect_signatures(case, readings, effects)[0]]


def _effect(
    name: str,
    at_stage: str,
    apply: Callable[[Any, LoadCase, Real], Any],
    reference: float,
    gear_types: tuple[type, ...] = (),
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
    own = {"name": name, "about": about, at_stage: act, "gear_types": gear_types}
    return type("StageChange", (StageChange,), own)


def _normal(stress: Stress, load_case: LoadCase, size: Real) -> Stress:
    return with_normal(stress, stress.normal * (1.0 + size), load_case.soil)


def _shear(stress: Stress, load_case: LoadCase, size: Real) -> Stress:
    return replace(stress, shear=stress.shear * (1.0 + size))


def _entry(rim: WheelArc, load_case: LoadCase, size: Real) -> WheelArc:
    return replace(rim, entry=rim.entry * (1.0 + size), peak=rim.peak * (1.0 + size))


def _exit(rim: WheelArc, load_case: LoadCase, size: Real) -> WheelArc:
    return replace(rim, exit=rim.exit - size * rim.entry)


def _peak(rim: WheelArc, load_case: LoadCase, size: Real) -> WheelArc:
    return replace(rim, peak=rim.peak + size * rim.entry)


def _lever(rim: WheelArc, load_case: LoadCase, size: Real) -> WheelArc:
    out = size * rim.radius
    return replace(rim, shear_radius=rim.shear_radius + out, lever=rim.lever + out)


def _slip(at: Operating, load_case: LoadCase, size: Real) -> Operating:
    return replace(at, slip=at.slip + size)


def _load(at: Operating, load_case: LoadCase, size: Real) -> Operating:
    return replace(at, load=at.load * (1.0 + size))


_CHANGES = [
    (NORMAL, _effect("change-normal", "on_stress", _normal, 0.1)),
    (SHEAR, _effect("change-shear", "on_stress", _shear, 0.1)),
    (GEOMETRY, _effect("change-entry", "on_contact", _entry, 0.1, (RigidWheel,))),
    (GEOMETRY, _effect("change-exit", "on_contact", _exit, 0.2, (RigidWheel,))),
    (GEOMETRY, _effect("change-peak", "on_contact", _peak, 0.1, (RigidWheel,))),
    (GEOMETRY, _effect("change-lever", "on_contact", _lever, 0.05, (RigidWheel,))),
    (OPERATING, _effect("change-slip", "on_operating", _slip, 0.02)),
    (OPERATING, _effect("change-load", "on_operating", _load, 0.05)),
]
