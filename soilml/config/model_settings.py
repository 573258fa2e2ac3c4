"""Gears and effects as they are written in a model file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from typing import Any

from soilml.config.prior_settings import take_prior
from soilml.config.units import take_quantity
from soilml.errors import InputError, did_you_mean
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter, check, declared
from soilml.physics.effects import Effect
from soilml.physics.gears import GEARS
from soilml.physics.gears.base import Gear
from soilml.physics.model import Model

#: Name of the gear in [gear], beside those in [gears.NAME].
UNNAMED_GEAR = "gear"
_GEAR_NAME = re.compile(r"[A-Za-z0-9_-]+")

Effects = Mapping[str, type[Effect]]


def take_gear(settings: Settings) -> Gear:
    """The gear in a table [gear] or [gears.NAME]."""
    gear_type = settings.text("type")
    if gear_type not in GEARS:
        settings.fail(
            f"type is {gear_type!r}; {did_you_mean(gear_type, GEARS)}there are: {', '.join(GEARS)}"
        )
    gear: Gear = take_instance(GEARS[gear_type], settings)
    settings.finish()
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
        tables[name] = Settings(
            named.take(name, dict, f"a table [gears.{name}]"),
            f"{settings.where} [gears.{name}]",
            settings.folder,
        )
    gears, priors = {}, {}
    for name, own in tables.items():
        entries = own.tables("effect")
        model, own_priors = take_effects(entries, effects, Model(take_gear(own)))
        gears[name] = model
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
            model = model + take_instance(effects[name], entry)
        except InputError as error:
            entry.fail(str(error).removeprefix(f"{entry.where}: "))
        entry.finish()
        prior |= {f"{name}.{k}": v for k, v in take_priors(priors, effects[name]).items()}
    return model, prior


def take_instance(cls: type, settings: Settings) -> Any:
    """An instance of a parameter-bearing dataclass from a table's keys of the same names."""
    parameters = declared(cls)
    values = {
        f.name: settings.text(f.name)
        if isinstance(f.default, str)
        else take_quantity(settings, f.name, parameters[f.name].unit)
        if f.name in parameters
        else settings.number(f.name)
        for f in fields(cls)
        if f.name in settings or f.default is MISSING
    }
    settings.permit(f.name for f in fields(cls))
    try:
        made = cls(**values)
    except InputError as error:
        settings.fail(str(error))
    check(made, f"{settings.where}: ")
    return made


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
