"""What an effect is, and how effects act on a model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from soilml.arrays import Array
from soilml.errors import InputError
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.gears.track import Track
from soilml.physics.operating_point import COVARIATES

T = TypeVar("T")

#: The stages of a model, in the order in which they run, and the value that each passes on.
STAGES = {
    "on_operating": "Operating: what the slip and load sensors report -> what the gear does",
    "on_soil": "Soil: the soil as it is at this slip, speed or pass",
    "on_contact": "the gear's shape in the soil (for wheels a WheelArc)",
    "on_stress": "Stress at the points of the contact, which it carries",
    "on_force": "Force at any sinkage, inside the search for equilibrium",
    "on_reading": "Force at equilibrium -> what the sensors report",
}

#: Where the cause of an effect may sit.
KINDS = ("soil", "wheel", "rig", "sensor")


@runtime_checkable
class Effect(Protocol):
    """A named pure function of one stage of a model, or of several.

    An effect is a frozen dataclass of its parameters. It acts through the methods it has, any of
    `STAGES`, each `(value, scene) -> value`. With its parameters at their defaults it changes
    nothing, to the last bit.
    """

    name: ClassVar[str]
    about: ClassVar[EffectCard]


@dataclass(frozen=True)
class EffectCard:
    """What a user should know of an effect before adding it."""

    text: str
    source: str
    #: where the cause sits, one of `KINDS`
    kind: str
    #: its size and a value of it that matters on a small rover; the first parameter named here is
    #: the one that a search for missing effects fits
    reference: dict[str, float]
    #: sign of the change that the reference size makes, channel -> -1 or +1, driving at slip > 0.1
    signs: dict[str, int]
    #: runs that would tell it from others
    isolate: str
    #: it changes the arc of a rigid wheel, or needs its radius: for no other gear
    wheel: bool = False
    #: it sits on the belt of a track: for no other gear
    track: bool = False
    #: fields of `Operating` that must be given, and must vary for the effect to be found
    needs: tuple[str, ...] = ()
    #: what the runs of one model cannot vary, and a search for missing effects thus cannot test
    varied: str = ""
    #: for sensors and rigs: how large the fault may be in a setup that was checked, one standard
    #: deviation, in the unit of its size; None where nothing is known
    calibration: float | None = None

    @property
    def size(self) -> str:
        """The parameter that is the size of the effect."""
        return next(iter(self.reference))


def suits(effect: Any, gear: Any) -> bool:
    """Whether an effect, or its class, means something for this gear."""
    about = getattr(effect, "about", None)
    if about is None:
        return True
    rigid, track = isinstance(gear, RigidWheel), isinstance(gear, Track)
    return (rigid or not about.wheel) and (track or not about.track)


def covariate(scene: Any, field: str, effect: str) -> Array:
    """What an effect needs to know of the driving; raises `InputError` where nobody measured it."""
    value = getattr(scene.at, field)
    if value is None:
        raise InputError(f"the effect {effect} needs the column {COVARIATES[field]}")
    return value


def through(effects: Iterable[Any], stage: str, value: T, scene: Any) -> T:
    """`value` after all effects that act at this stage, in the order of the model."""
    for effect in effects:
        act = getattr(effect, stage, None)
        if act is not None:
            value = act(value, scene)
    return value
