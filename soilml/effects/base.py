"""What an effect is, and how effects act on a model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

T = TypeVar("T")

#: The stages of a model, in the order in which they run, and the value that each passes on.
STAGES = {
    "on_operating": "Operating: what the slip and load sensors report -> what the gear does",
    "on_soil": "Soil: the soil as it is at this slip, speed or pass",
    "on_contact": "the gear's shape in the soil (for wheels a Rim)",
    "on_stress": "Stress at the points of the contact, which it carries",
    "on_force": "Force at any sinkage, inside the search for equilibrium",
    "on_reading": "Force at equilibrium -> what the sensors report",
}


@runtime_checkable
class Effect(Protocol):
    """A named pure function of one stage of a model, or of several.

    An effect is a frozen dataclass of its parameters. It acts through the methods it has, any of
    `STAGES`, each `(value, scene) -> value`. With its parameters at `neutral` it changes nothing,
    to the last bit.
    """

    name: ClassVar[str]
    about: ClassVar[EffectCard]


@dataclass(frozen=True)
class EffectCard:
    """What a user should know of an effect before adding it."""

    text: str
    source: str
    neutral: dict[str, float]
    #: a size that matters on a small rover, for pictures and tests
    reference: dict[str, float]
    #: sign of the change that the reference size makes, channel -> -1 or +1, driving at slip > 0.1
    signs: dict[str, int]


def through(effects: Iterable[Any], stage: str, value: T, scene: Any) -> T:
    """`value` after all effects that act at this stage, in the order of the model."""
    for effect in effects:
        act = getattr(effect, stage, None)
        if act is not None:
            value = act(value, scene)
    return value
