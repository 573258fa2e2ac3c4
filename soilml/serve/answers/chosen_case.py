"""The case that the page has chosen: a wheel and a soil of the lists, or a model file."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import Any

from soilml.config.case import Case, read_case
from soilml.errors import InputError
from soilml.parameters import located
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.gears.base import Gear
from soilml.physics.model import Model
from soilml.physics.soils import soil
from soilml.serve.answers.choices import FIRST_SOIL, FIRST_WHEEL, WHEELS

#: Name of a model file in messages.
MODEL_FILE = "MODEL.toml"
#: Kinds of effects that the page offers; those of sensors belong to a log.
_OPERATING: tuple[str, ...] = ("slip", "load")
OFFERED_KINDS = ("soil", "wheel", "rig")


def whole_case(request: dict[str, Any]) -> Case:
    """The case of a request before its sliders; `InputError` for an unknown name or bad file."""
    text = request.get("model")
    if isinstance(text, str) and text.strip():
        return case_of_text(text)
    wheel = request.get("wheel", FIRST_WHEEL)
    if not isinstance(wheel, str) or wheel not in WHEELS:
        raise InputError(f"no wheel {wheel!r}; there are: {', '.join(WHEELS)}")
    name = request.get("soil", FIRST_SOIL)
    if not isinstance(name, str):
        raise InputError("soil: needed is the name of a soil")
    return Case(Model(WHEELS[wheel].gear()), soil(name))


@lru_cache(maxsize=16)
def case_of_text(text: str) -> Case:
    """The case of the text of a model file; errors name `MODEL_FILE`."""
    with tempfile.TemporaryDirectory(prefix="soilml-model-") as folder:
        path = Path(folder) / MODEL_FILE
        path.write_text(text, encoding="utf-8")
        try:
            return read_case(path, with_bias=True)
        except InputError as error:
            raise InputError(str(error).replace(str(path), MODEL_FILE)) from None


def forward_case(request: dict[str, Any]) -> Case:
    """The case of one gear, the first where a file has several, with every effect on offer.

    Effects that the case lacks are added with their default parameters, which change nothing.
    """
    case = whole_case(request)
    if case.gears:
        case = case.of_gear(next(iter(case.gears)))
    own = {effect.name for effect in case.model.effects}
    added = [effect() for effect in offered_effects(case.model.gear) if effect.name not in own]
    return replace(case, model=replace(case.model, effects=(*case.model.effects, *added)))


def offered_effects(gear: Gear) -> list[type[Effect]]:
    """Effects of the catalogue that need nothing but slip and load on this gear."""
    return [
        effect
        for effect in EFFECTS.values()
        if effect.about.kind in OFFERED_KINDS and not effect.about.needs and _applies(effect, gear)
    ]


def _applies(effect: type[Effect], gear: Gear) -> bool:
    return not effect.gear_types or isinstance(gear, effect.gear_types)


def with_sliders(case: Case, request: dict[str, Any]) -> tuple[Case, dict[str, float]]:
    """The case with the sliders' values, without effects at their defaults; slip and load.

    Raises `InputError` for values that are no numbers, unknown or outside their bounds.
    """
    given = request.get("values", {})
    if not isinstance(given, dict):
        raise InputError("values: needed are numbers by name")
    values: dict[str, float] = {}
    for path, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise InputError(f"{path}: needed is a number")
        values[str(path)] = float(value)
    at: dict[str, float] = {key: values.pop(key) for key in (*_OPERATING,) if key in values}
    case = case.with_values(values)
    needed = tuple(effect for effect in case.model.effects if not _is_default(effect))
    return replace(case, model=replace(case.model, effects=needed)), at


def _is_default(effect: Effect) -> bool:
    """Whether an effect of the list changes nothing; one of a user's file always stays."""
    if EFFECTS.get(effect.name) is not type(effect):
        return False
    default = located(type(effect)())
    return all(default[path][1] == entry[1] for path, entry in located(effect).items())
