"""Gears, effects, the soil and priors as they are written in a model file, with their units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from soilml.errors import InputError, did_you_mean
from soilml.io.declared_settings import in_si, take_declared, take_quantity
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter, check, declared, with_values
from soilml.physics.effects import Effect
from soilml.physics.gears import GEARS
from soilml.physics.gears.base import Gear
from soilml.physics.model import Model
from soilml.physics.soils import Soil, soil
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength, SoilTest

UNNAMED_GEAR = "gear"  # Name of the gear in [gear], beside those in [gears.NAME]
#: Priors about zero by the name that they have in a model file.
NORMAL = {"normal": Prior.normal, "half-normal": Prior.half_normal}
#: Kinds of tests; the key of the measured quantity identifies the kind.
_TEST_KINDS: tuple[type[SoilTest], ...] = (PlatePressure, ShearStrength)
_GEAR_NAME = re.compile(r"[A-Za-z0-9_-]+")

Effects = Mapping[str, type[Effect]]


def take_gear(settings: Settings) -> Gear:
    """The gear in a table [gear] or [gears.NAME]."""
    gear_type = settings.text("type")
    if gear_type not in GEARS:
        settings.fail(
            f"type is {gear_type!r}; {did_you_mean(gear_type, GEARS)}there are: {', '.join(GEARS)}"
        )
    gear: Gear = take_declared(GEARS[gear_type], settings)
    return gear


def take_gears(settings: Settings, effects: Effects) -> tuple[dict[str, Model], dict[str, Prior]]:
    """The gears in [gear], where it is present, and in [gears.NAME], with their own effects.

    The priors are those of the effects, by path: `grousers@lugged.height`.
    """
    tables = {}
    if "gear" in settings:
        tables[UNNAMED_GEAR] = settings.table("gear")
    named = settings.table("gears")
    for name in named.content:
        if not _GEAR_NAME.fullmatch(name):
            named.fail(f"{name!r} is no name of a gear; needed are letters, digits, - and _")
        if name in tables:
            named.fail(f"{name!r} is the name of the gear in [gear]; take another one")
        tables[name] = named.table(name)
    gears, priors = {}, {}
    for name, own in tables.items():
        entries = own.tables("effect")
        gears[name], own_priors = take_effects(entries, effects, Model(take_gear(own)))
        for path, prior in own_priors.items():
            effect, _, parameter = path.partition(".")
            priors[f"{effect}@{name}.{parameter}"] = prior
    return gears, priors


def take_effects(
    entries: list[Settings], effects: Effects, model: Model
) -> tuple[Model, dict[str, Prior]]:
    """The model with the effects of tables [[effect]], and their priors by path."""
    prior: dict[str, Prior] = {}
    for entry in entries:
        name = entry.text("name")
        if name not in effects:
            entry.fail(
                f"name is {name!r}; {did_you_mean(name, effects)}there are: {', '.join(effects)}"
            )
        priors = entry.table("prior")
        try:
            model = model + take_declared(effects[name], entry)
        except InputError as error:
            entry.fail(str(error).removeprefix(f"{entry.where}: "))
        prior |= {f"{name}.{k}": v for k, v in take_priors(priors, effects[name]).items()}
    return model, prior


def take_soil(settings: Settings) -> tuple[Soil, dict[str, Prior], tuple[SoilTest, ...]]:
    """The soil in a table [soil], its priors by name, and the tests in [[soil.test]]."""
    priors = settings.table("prior")
    tests = tuple(_take_test(entry) for entry in settings.tables("test"))
    if "name" in settings:
        name = settings.text("name")
        try:
            base = soil(name)
        except InputError as error:
            settings.fail(str(error))
        made = changed_soil(settings, base)
    else:
        made = take_declared(Soil, settings)
    return made, take_priors(priors, Soil), tests


def changed_soil(settings: Settings, base: Soil) -> Soil:
    """A soil with the values that a table has instead of its own."""
    values = {
        key: take_quantity(settings, key, parameter.unit)
        for key, parameter in declared(Soil).items()
        if key in settings
    }
    settings.permit(declared(Soil))
    settings.finish()
    made = with_values(base, values)
    check(made, f"{settings.where}: ")
    return made


def _take_test(settings: Settings) -> SoilTest:
    kinds = [kind for kind in _TEST_KINDS if kind.quantity in settings]
    if len(kinds) != 1:
        settings.fail(
            "needed is pressure (Pa), with plate_width and sinkage, or strength (Pa), with "
            "normal_stress; and scatter, such as '15 %'"
        )
    return take_declared(kinds[0], settings)


def take_prior(settings: Settings, key: str, *, unit: str = "1", about_zero: bool = False) -> Prior:
    """Read `key = [lower, upper]` or `key = { range = [lower, upper], scale = "log" }`.

    With `about_zero`, also a normal prior about zero, `{ normal = 0.2 }`, or its positive half,
    `{ half-normal = 0.2 }`. Numbers are in the SI unit `unit`, or texts with a unit: "25 deg".
    """
    needed = "[lower, upper], or { range = [lower, upper], scale = 'log' }"
    if about_zero:
        needed += ", or { normal = std }, or { half-normal = std }"
    value = settings.take(key, (list, dict), needed)
    given = value if isinstance(value, dict) else {"range": value}

    def number(x: Any) -> float:
        x = in_si(settings, key, x, unit) if isinstance(x, str) else x
        return float(x) if isinstance(x, int | float) and not isinstance(x, bool) else math.nan

    kind = next(iter(given), "")
    if about_zero and len(given) == 1 and kind in NORMAL:
        if not 0.0 < (std := number(given[kind])) < math.inf:
            settings.fail(
                f"{key}: {kind} is {given[kind]!r}; needed is a standard deviation above zero"
            )
        return NORMAL[kind](std)
    scale, ends = given.get("scale", "linear"), given.get("range")
    if given.keys() - {"range", "scale"} or scale not in ("log", "linear"):
        settings.fail(f"{key} is {value!r}; needed is {needed}")
    numbers = [number(x) for x in ends] if isinstance(ends, list) else []
    if len(numbers) != 2 or not -math.inf < numbers[0] < numbers[1] < math.inf:
        settings.fail(f"{key} is {ends!r}; needed is {needed} with lower below upper")
    if scale == "log" and numbers[0] <= 0.0:
        settings.fail(f"{key}: a logarithmic range must be positive, it begins at {numbers[0]:g}")
    return Prior(numbers[0], numbers[1], scale == "log")


def _within_bounds(settings: Settings, key: str, prior: Prior, parameter: Parameter) -> Prior:
    """A normal prior, cut off at the bounds of its parameter."""
    lower, upper = max(prior.lower, parameter.lower), min(prior.upper, parameter.upper)
    if prior.lower < 0.0 <= parameter.lower:
        settings.fail(
            f"{key}: a normal prior about zero has values below zero, which {key} cannot have; "
            f"needed is {{ half-normal = {prior.normal_std:g} }}, or a range"
        )
    if not lower < upper:
        settings.fail(f"{key}: a normal prior about zero lies outside the bounds of {key}")
    return replace(prior, lower=lower, upper=upper)


def take_priors(settings: Settings, cls: type) -> dict[str, Prior]:
    """Priors of the parameters that a dataclass declares, by name."""
    priors = {}
    settings.permit(declared(cls))
    for key, parameter in declared(cls).items():
        if key in settings:
            prior = take_prior(settings, key, unit=parameter.unit, about_zero=True)
            if prior.normal_std is not None:
                prior = _within_bounds(settings, key, prior, parameter)
            if not parameter.lower <= prior.lower < prior.upper <= parameter.upper:
                settings.fail(
                    f"{key} is [{prior.lower:g}, {prior.upper:g}]; it must lie between "
                    f"{parameter.lower:g} and {parameter.upper:g} {parameter.unit}"
                )
            priors[key] = prior
    settings.finish()
    return priors
