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

#: Stages of a model.
GEOMETRY, NORMAL, SHEAR = "contact geometry", "normal stress", "shear stress"
OPERATING = "slip or load"
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
    """What one change does to the readings."""

    stage: str
    columns: Floats  # (m, k): one of the same size in all rows, or of functions along the contact
    along: str = ""  # variable along the contact that it depends on, or empty


def stage_changes(case: Case, readings: Readings) -> list[Change]:
    """The changes that the gears of a case can have, by how they change each reading.

    Changes without an equilibrium, or without influence, are left out.
    """
    gears = [model.gear for model in (case.model, *case.gears.values())]
    kinds = [*((stage, "", [e]) for stage, e in _PLAIN if all(map(e.applies_to, gears)))]
    depth = float(np.nanmax(np.asarray(forces(case, readings.at).sinkage), initial=0.0))
    if depth > 0.0:
        sheared = SHEARED * float(np.max(np.asarray(case.soil.shear_modulus)))
        kinds.append((NORMAL, "depth", [_by_depth(i, depth) for i in range(ALONG)]))
        kinds.append((SHEAR, "shear displacement", [_by_shear(i, sheared) for i in range(ALONG)]))
    effects = {e.name: e for _, _, own in kinds for e in own}
    found = {s.name: s.column for s in effect_signatures(case, readings, effects)[0]}
    changes = []
    for stage, along, own in kinds:
        columns = [found[e.name] for e in own if e.name in found]
        if len(columns) > bool(along):
            changes.append(Change(stage, np.stack(columns, axis=1), along))
    return changes


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


_PLAIN = [
    (NORMAL, _effect("change-normal", "on_stress", _normal, 0.1)),
    (SHEAR, _effect("change-shear", "on_stress", _shear, 0.1)),
    (GEOMETRY, _effect("change-entry", "on_contact", _entry, 0.1, (RigidWheel,))),
    (GEOMETRY, _effect("change-exit", "on_contact", _exit, 0.2, (RigidWheel,))),
    (GEOMETRY, _effect("change-peak", "on_contact", _peak, 0.1, (RigidWheel,))),
    (GEOMETRY, _effect("change-lever", "on_contact", _lug, 0.05, (RigidWheel,))),
    (OPERATING, _effect("change-slip", "on_operating", _slip, 0.02)),
    (OPERATING, _effect("change-load", "on_operating", _load, 0.05)),
]


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
        return _normal(stress, load_case, size * _bump(stress.contact.depth, number, largest))

    return _effect(f"change-normal-{number}", "on_stress", apply, 0.1)


@cache
def _by_shear(number: int, largest: float) -> type[Effect]:
    def apply(stress: Stress, load_case: LoadCase, size: Real) -> Stress:
        bump = _bump(stress.contact.shear_displacement, number, largest)
        return _shear(stress, load_case, size * bump)

    return _effect(f"change-shear-{number}", "on_stress", apply, 0.1)
