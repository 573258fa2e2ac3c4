"""The catalogue of published soils, one TOML file per paper beside this one."""

from __future__ import annotations

import difflib
import tomllib
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib import resources
from typing import Any

from soilml.arrays import Real
from soilml.errors import InputError
from soilml.physics.soils.soil import Soil


@dataclass(frozen=True)
class SoilEntry:
    """A soil of the catalogue: its values, where they are printed, and what had to be assumed."""

    name: str
    soil: Soil
    source: str
    text: str
    assumed: tuple[str, ...]
    published: dict[str, float]


@cache
def soil_catalogue() -> dict[str, SoilEntry]:
    """Every published soil by name, `paper/soil`; one TOML file per paper in `soilml/soils`."""
    found = {}
    for file in sorted(resources.files("soilml.physics.soils").iterdir(), key=str):
        if not file.name.endswith(".toml"):
            continue
        content = tomllib.loads(file.read_text(encoding="utf-8"))
        assumed_by_all = content.get("assumed", {})
        for key, entry in content["soil"].items():
            name = f"{file.name.removesuffix('.toml')}/{key}"
            found[name] = _entry(name, content["source"], assumed_by_all, entry)
    return found


def _entry(name: str, source: str, assumed: dict[str, float], entry: dict[str, Any]) -> SoilEntry:
    own_assumed = assumed | entry.get("assumed", {})
    known = {field.name for field in fields(Soil)}
    published = {key: float(value) for key, value in entry.items() if key in known}
    # a negative cohesion is an artefact of a straight line through shear tests: models use none
    usable = {k: max(v, 0.0) if k == "cohesion" else v for k, v in published.items()}
    given = {key: value for key, value in own_assumed.items() if key not in usable}
    return SoilEntry(
        name=name,
        soil=Soil(**(given | usable)),
        source=source,
        text=entry["text"],
        assumed=tuple(sorted(given)),
        published=published,
    )


def soil(name: str, **changes: Real) -> Soil:
    """The catalogue's soil `name`, with single values replaced.

    Raises `InputError` for a name or a field that does not exist.
    """
    catalogue = soil_catalogue()
    if name not in catalogue:
        near = difflib.get_close_matches(name, catalogue, 1, 0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InputError(f"no soil {name!r}: {hint}`soilml soils` lists the catalogue")
    try:
        return replace(catalogue[name].soil, **changes)
    except TypeError:
        known = {field.name for field in fields(Soil)}
        wrong = sorted(changes.keys() - known)[0]
        raise InputError(f"a soil has no {wrong!r}; it has: {', '.join(sorted(known))}") from None
