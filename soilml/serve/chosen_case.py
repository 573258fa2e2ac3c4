"""The case that the page has chosen: a wheel and a soil of its lists, or a model file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import Any

from soilml.config.case import Case, read_case
from soilml.errors import InputError
from soilml.io.named_files import NO_FILES
from soilml.parameters import located
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.gears import Track, Wheel
from soilml.physics.gears.base import Gear
from soilml.physics.model import Model
from soilml.physics.soils import soil, soil_catalogue
from soilml.serve.job_commands import MODEL_FILE

#: Kinds of effects that the page offers; those of sensors belong to a log.
_OPERATING: tuple[str, ...] = ("slip", "load")
OFFERED_KINDS = ("soil", "wheel", "rig")


@dataclass(frozen=True)
class WheelChoice:
    """A running gear of the list, with the load (N) that it typically carries."""

    label: str
    source: str
    gear: Callable[[], Gear]
    load: float


#: Running gears by the name that the page sends.
WHEELS: dict[str, WheelChoice] = {
    "example": WheelChoice(
        "Wheel of the README, 150 × 120 mm",
        "radius 150 mm, width 120 mm: the wheel of the examples and of the released model files",
        lambda: Wheel(radius=0.15, width=0.12),
        60.0,
    ),
    "nagatani2009": WheelChoice(
        "Force-sensor wheel, 55 × 64 mm",
        "Nagatani et al. 2009: wheel with force sensors in its rim",
        lambda: Wheel(radius=0.055, width=0.064),
        28.92,
    ),
    "kls1": WheelChoice(
        "Wheel of the KLS-1 tests, 85 × 80 mm",
        "the smooth wheel of the tests on the lunar simulant KLS-1",
        lambda: Wheel(radius=0.085, width=0.080),
        58.9,
    ),
    "comin2017": WheelChoice(
        "Wheel beside the wheel-legs, 150 × 180 mm",
        "Comin and Saaj 2017: the wheel that wheel-legs are compared with",
        lambda: Wheel(radius=0.15, width=0.18),
        490.5,
    ),
    "wang2018": WheelChoice(
        "Track of the tracked robot, 600 mm long",
        "Wang et al. 2018: one of two tracks of a robot of 130 kg",
        lambda: Track(radius=0.1, width=0.08, base=0.6),
        637.6,
    ),
}
FIRST_WHEEL, FIRST_SOIL = "example", "wong1989/dry_sand"  # What the page shows first


def choices() -> dict[str, Any]:
    """The lists of the page."""
    from soilml import __version__

    return {
        "version": __version__,
        "wheels": [
            {"id": key, "label": wheel.label, "note": wheel.source} for key, wheel in WHEELS.items()
        ],
        "soils": [
            {"id": name, "label": f"{entry.text} – {name}", "note": _source(entry)}
            for name, entry in soil_catalogue().items()
        ],
        "first": {"wheel": FIRST_WHEEL, "soil": FIRST_SOIL},
    }


def _source(entry: Any) -> str:
    assumed = f"; assumed, not printed there: {', '.join(entry.assumed)}" if entry.assumed else ""
    return f"{entry.source}{assumed}"


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
            return read_case(path, with_bias=True, files=NO_FILES, with_explanations=True)
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
        if effect.about.kind in OFFERED_KINDS
        and not effect.about.needs
        and (not effect.gear_types or isinstance(gear, effect.gear_types))
    ]


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
