"""What an effect is, and how effects act on a model."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, ClassVar, TypeVar, dataclass_transform, final

from soilml.arrays import Array, Real, namespace
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.physics.contact import Force, Stress
from soilml.physics.gears.base import Gear
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.physics.soils import Soil

T = TypeVar("T")

#: The stages of a model, in the order in which they run, and the value that each passes on.
STAGES = {
    "on_operating": "Operating: what the slip and load sensors report -> what the gear does",
    "on_soil": "Soil: the soil as it is at this slip, speed or pass",
    "on_contact": "the geometry of the gear in the soil (for wheels a WheelArc)",
    "on_stress": "Stress at the points of the contact, which it carries",
    "on_force": "Force at any sinkage, inside the search for equilibrium",
    "on_reading": "Force at equilibrium -> what the sensors report",
}

#: Slip ratio and load (N) at which the size of an effect is its parameter's value.
REFERENCE_SLIP, REFERENCE_LOAD = 0.3, 100.0
#: Slip ratio added where a size is a power of slip, so that it stays finite at zero slip.
SLIP_OFFSET = 0.03

KINDS = ("soil", "wheel", "rig", "sensor")  # Where the cause of an effect may lie


@dataclass(frozen=True)
class EffectCard:
    """What a user should know of an effect before adding it to a model."""

    text: str
    source: str
    #: where the cause lies, one of `KINDS`
    kind: str
    #: its size and a value of it that matters on a small rover; the first parameter named here is
    #: the one that a search for missing effects fits
    reference: dict[str, float]
    #: runs that would distinguish it from other effects
    isolate: str
    #: sign of the change that the reference size makes, channel -> -1 or +1, driving at slip > 0.1
    signs: dict[str, int] = field(default_factory=dict)
    #: fields of `Operating` that must be given, and must vary for the effect to be identifiable
    needs: tuple[str, ...] = ()
    #: fields of `Operating` that it uses where they are known
    uses: tuple[str, ...] = ()
    #: what the runs of one gear cannot vary, so that a search for missing effects cannot test it
    varied: str = ""
    #: the dimension of the gear whose variation between several gears is what `varied` asks for
    varied_dimension: str = ""
    #: for sensors and rigs: standard deviation of the fault that remains in a checked setup, in the
    #: unit of the effect's size; None where it is unknown
    calibration: float | None = None
    #: the law that it is another form of; a search names one effect of a family at most
    family: str = ""

    @property
    def size(self) -> str:
        """The parameter that is the size of the effect."""
        return next(iter(self.reference))


@dataclass(frozen=True)
class Effect:
    """A named pure function of one stage of a model, or of several.

    An effect is a frozen dataclass of its parameters, which the decorator `effect` makes of a class
    that derives from this one and overrides the stages that it acts at; the others pass their value
    on unchanged. With its parameters at their defaults it changes nothing, to the last bit.

    Raises `InputError` when a subclass is defined with a public method that begins with ``on_`` and
    is not one of `STAGES`.
    """

    name: ClassVar[str]
    about: ClassVar[EffectCard]
    #: the gear classes that the effect applies to; any gear where empty
    gear_types: ClassVar[tuple[type, ...]] = ()
    #: whether with it, as without it, the load that the soil carries rises with the sinkage of a
    #: driving gear; a search for equilibrium then needs no scan
    load_rises: ClassVar[bool] = False

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if fault := misspelt_stage(cls):
            raise InputError(f"{cls.__name__}: {fault}")

    @classmethod
    def applies_to(cls, gear: Gear) -> bool:
        """Whether the effect has a meaning for this gear."""
        if isinstance(gear, EmulatedGear):  # without a contact to act at
            return not (cls.gear_types or cls.overrides("on_contact") or cls.overrides("on_stress"))
        return not cls.gear_types or isinstance(gear, cls.gear_types)

    @classmethod
    def overrides(cls, stage: str) -> bool:
        """Whether the effect acts at this stage, one of `STAGES`."""
        base: type = cls
        return stage in _overridden(base)

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        """The true slip and load, from those that the sensors report."""
        return at

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        """The soil at this slip, speed or pass."""
        return soil

    def on_contact(self, geometry: Any, load_case: LoadCase) -> Any:
        """The geometry of the contact, of the type that the gear's `contact_geometry` returns."""
        return geometry

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        """The stresses at the points of the contact."""
        return stress

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        """The forces at any sinkage, inside the search for equilibrium."""
        return force

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        """What the sensors report, from the forces at equilibrium."""
        return force


E = TypeVar("E", bound=Effect)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def effect(name: str, **card: Any) -> Callable[[type[E]], type[E]]:
    """Declare an effect: a frozen dataclass with this name and a card, see `EffectCard`.

    The card's text is by default the first sentence of the class's docstring.
    """

    def made(cls: type[E]) -> type[E]:
        said = ((cls.__doc__ or "").strip() or name).partition("\n")[0].rstrip(".")
        cls.name, cls.about = name, EffectCard(**{"text": said[0].lower() + said[1:]} | card)
        return dataclass(frozen=True, kw_only=True)(cls)

    return made


@cache
def _overridden(cls: type) -> frozenset[str]:
    return frozenset(name for name in STAGES if getattr(cls, name) is not getattr(Effect, name))


def misspelt_stage(cls: type) -> str:
    """Message on a public method of `cls` that begins with ``on_`` and is no stage; else empty."""
    for name in dir(cls):
        if name.startswith("on_") and name not in STAGES and callable(getattr(cls, name)):
            near = difflib.get_close_matches(name, STAGES, 1, 0.5)
            hint = f"did you mean {near[0]}? " if near else ""
            return f"{name} is not a stage of a model; {hint}The stages are: {', '.join(STAGES)}"
    return ""


def covariate(load_case: LoadCase, field: str, effect: str) -> Array:
    """A field of `Operating` that an effect needs; raises `InputError` where it is missing."""
    value = getattr(load_case.at, field)
    if value is None:
        raise InputError(f"the effect {effect} needs the column {COVARIATES[field]}")
    return value


def apply_stage(effects: Iterable[Effect], stage: str, value: T, load_case: LoadCase) -> T:
    """`value` after all effects that act at this stage, in the order of the model."""
    for effect in effects:
        if effect.overrides(stage):
            value = getattr(effect, stage)(value, load_case)
    return value


def log_relative_slip(slip: Array) -> Array:
    """Natural logarithm of the slip ratio's magnitude, relative to the reference; finite at 0."""
    xp = namespace(slip)
    return xp.log((xp.abs(slip) + SLIP_OFFSET) / (REFERENCE_SLIP + SLIP_OFFSET))


@dataclass(frozen=True, kw_only=True)
class SlipLoadScaling(Effect):
    r"""An effect whose cause is known and whose law is not: its size may vary with slip and load.

    .. math::
        a(s, W) = a \left( \frac{|s| + 0.03}{0.33} \right)^{p_s} (W / 100 N)^{b_W}
        e^{b_s (|s| - 0.3)}

    All three exponents are zero unless they were fitted to data. The power describes effects that
    need slip (exponent near 1). The exponential describes those that saturate or grow steeply at
    high slip. `law_terms` are the exponents that may be fitted: the deflection of a wheel, for one,
    does not depend on slip.
    """

    law_terms: ClassVar[tuple[str, ...]] = ("slip_power", "by_slip", "by_load")
    by_slip: Annotated[Real, Parameter("1", -20.0, 20.0, "growth of the size with slip")] = 0.0
    slip_power: Annotated[Real, Parameter("1", -5.0, 5.0, "power of slip that the size has")] = 0.0
    by_load: Annotated[Real, Parameter("1", -5.0, 5.0, "power of load that the size has")] = 0.0

    @final
    def scaled(self, size: Real, load_case: LoadCase) -> Array:
        """The size at the slip and load of a load case; unchanged, to the last bit, by default."""
        xp = namespace(load_case.at.slip)
        slip = xp.abs(load_case.at.slip)
        power = self.by_slip * (slip - REFERENCE_SLIP)
        power = power + self.slip_power * log_relative_slip(slip)
        power = power + self.by_load * xp.log(load_case.at.load / REFERENCE_LOAD)
        return size * xp.exp(power)
