"""Changes at each stage of a model that no effect of a catalogue names, and their signatures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any

import numpy as np

from soilml.arrays import Array, Floats, Real, namespace
from soilml.config.case import Case
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_normal
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating

#: Functions of depth, or of shear displacement, along the contact, from the smallest share of the
#: largest one to it; their width is the distance of two in the logarithm.
ALONG, SMALLEST_SHARE = 5, 0.04

#: Largest shear displacement of these functions, in shear moduli: strength is mobilised there.
SHEARED = 8.0


@dataclass(frozen=True, kw_only=True)
class StageChange(Effect):
    """A change at one stage, by a size."""

    size: Annotated[Real, Parameter("1", -10.0, 10.0, "relative size of the change")] = 0.0


@dataclass(frozen=True)
class Change:
    """What one change does to the readings.

    stage: Of the model: contact geometry, normal stress, shear stress, or slip or load.
    what: What of the stage it changes.
    columns: Changes (m, k) of the readings: one for a change of the same size in all rows, several
        for functions along the contact.
    along: Variable along the contact that it depends on, or empty.
    """

    stage: str
    what: str
    columns: Floats
    along: str = ""


def stage_changes(case: Case, readings: Readings) -> list[Change]:
    """The changes that the gears of a case can have, by how they change each reading.

    Changes without an equilibrium, or without influence, are left out.
    """
    kinds = [*_PLAIN, *_along_contact(case, readings)]
    models = (case.model, *case.gears.values())
    kinds = [k for k in kinds if all(k.effect.applies_to(m.gear) for m in models)]
    signatures, _ = effect_signatures(case, readings, {k.effect.name: k.effect for k in kinds})
    found = {s.name: s.column for s in signatures}
    groups: dict[tuple[str, str, str], list[Floats]] = {}
    for kind in kinds:
        if kind.effect.name in found:
            key = kind.stage, kind.what, kind.along
            groups.setdefault(key, []).append(found[kind.effect.name])
    return [
        Change(stage, what, np.stack(columns, axis=1), along)
        for (stage, what, along), columns in groups.items()
        if not along or len(columns) > 1
    ]


@dataclass(frozen=True)
class _Kind:
    stage: str
    what: str
    effect: type[Effect]
    along: str = ""


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


def _lug(rim: WheelArc, load_case: LoadCase, size: Real) -> WheelArc:
    out = size * rim.radius
    return replace(rim, shear_radius=rim.shear_radius + out, lever=rim.lever + out)


def _slip(at: Operating, load_case: LoadCase, size: Real) -> Operating:
    return replace(at, slip=at.slip + size)


def _load(at: Operating, load_case: LoadCase, size: Real) -> Operating:
    return replace(at, load=at.load * (1.0 + size))


_WHEEL = (RigidWheel,)
_PLAIN = [
    _Kind("normal stress", "its size", _effect("change-normal", "on_stress", _normal, 0.1)),
    _Kind("shear stress", "its size", _effect("change-shear", "on_stress", _shear, 0.1)),
    _Kind("contact geometry", "entry", _effect("change-entry", "on_contact", _entry, 0.1, _WHEEL)),
    _Kind("contact geometry", "exit", _effect("change-exit", "on_contact", _exit, 0.2, _WHEEL)),
    _Kind("contact geometry", "peak", _effect("change-peak", "on_contact", _peak, 0.1, _WHEEL)),
    _Kind("contact geometry", "lever", _effect("change-lever", "on_contact", _lug, 0.05, _WHEEL)),
    _Kind("slip or load", "slip", _effect("change-slip", "on_operating", _slip, 0.02)),
    _Kind("slip or load", "load", _effect("change-load", "on_operating", _load, 0.05)),
]


def _along_contact(case: Case, readings: Readings) -> list[_Kind]:
    """Changes of the stresses by functions of depth and of shear displacement in the contact."""
    soil, force = case.soil, forces(case, readings.at)
    depth = float(np.nanmax(np.asarray(force.sinkage), initial=0.0))
    if not depth > 0.0:
        return []
    sheared = SHEARED * float(np.max(np.asarray(soil.shear_modulus)))
    found = []
    for i in range(ALONG):
        found.append(_Kind("normal stress", "its law", _by_depth(i, depth), "depth"))
        by_shear = _by_shear(i, sheared)
        found.append(_Kind("shear stress", "its law", by_shear, "shear displacement"))
    return found


def _bump(values: Array, number: int, largest: float) -> Array:
    """One of `ALONG` functions of the logarithm of values up to the largest."""
    xp = namespace(values)
    step = -np.log(SMALLEST_SHARE) / (ALONG - 1)
    least = xp.full_like(values, 1e-3 * SMALLEST_SHARE * largest)
    place = xp.log(xp.maximum(xp.abs(values), least) / largest) / step
    return xp.exp(-0.5 * (place + number) ** 2)


@cache
def _by_depth(number: int, largest: float) -> type[Effect]:
    def apply(stress: Stress, load_case: LoadCase, size: Real) -> Stress:
        factor = 1.0 + size * _bump(stress.contact.depth, number, largest)
        return with_normal(stress, stress.normal * factor, load_case.soil)

    return _effect(f"change-normal-{number}", "on_stress", apply, 0.1)


@cache
def _by_shear(number: int, largest: float) -> type[Effect]:
    def apply(stress: Stress, load_case: LoadCase, size: Real) -> Stress:
        factor = 1.0 + size * _bump(stress.contact.shear_displacement, number, largest)
        return replace(stress, shear=stress.shear * factor)

    return _effect(f"change-shear-{number}", "on_stress", apply, 0.1)
