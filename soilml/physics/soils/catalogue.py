"""The parameters of a soil, and the catalogue of published ones: a TOML file per paper, here."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib import resources
from typing import Annotated, Any, final

from soilml.arrays import Real
from soilml.errors import InputError, did_you_mean
from soilml.optional_imports import tomllib
from soilml.parameters import Parameter


@final
@dataclass(frozen=True, kw_only=True)
class Soil:
    r"""Shear strength, pressure-sinkage curve and angle of maximum stress of a soil, in SI units.

    .. math::
        \tau_{max} = c + \sigma \tan\varphi, \qquad
        \sigma = (k_c / b + k_\varphi) z^n, \qquad
        \theta_m = (a_0 + a_1 s) \theta_1

    References: Mohr-Coulomb; Bekker, Introduction to Terrain-Vehicle Systems, 1969; Wong and
    Reece, J. Terramechanics 4(1), 1967, eq. for the angle of maximum stress.

    Any field may be an array; a model broadcasts them against each other and the operating point.
    """

    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6, "c")]
    friction_angle: Annotated[Real, Parameter("rad", 0.0, 1.4, "phi, internal friction angle")]
    shear_modulus: Annotated[Real, Parameter("m", 1e-5, 1.0, "K, shear deformation modulus")]
    kc: Annotated[Real, Parameter("N/m^(n+1)", -1e8, 1e9, "cohesive modulus of sinkage")]
    kphi: Annotated[Real, Parameter("N/m^(n+2)", -1e9, 1e10, "frictional modulus of sinkage")]
    n: Annotated[Real, Parameter("1", 0.05, 3.0, "exponent of sinkage")]
    a0: Annotated[Real, Parameter("1", 0.0, 1.0, "theta_m / theta_1 at no slip")] = 0.4
    a1: Annotated[Real, Parameter("1", -1.0, 1.0, "growth of theta_m / theta_1 with slip")] = 0.15
    unit_weight: Annotated[Real, Parameter("N/m^3", 0.0, 5e4, "weight per volume")] = 15000.0


@dataclass(frozen=True)
class SoilEntry:
    """A soil of the catalogue: its values, where they are printed, and what had to be assumed.

    `spread` are ranges of parameters that the paper prints, in SI units.
    """

    name: str
    soil: Soil
    source: str
    text: str
    assumed: tuple[str, ...]
    published: dict[str, float]
    spread: dict[str, tuple[float, float]] = field(default_factory=dict)


@cache
def soil_catalogue() -> dict[str, SoilEntry]:
    """Every published soil by name, `paper/soil`, from one TOML file per paper.

    Examples
    --------
    >>> from soilml import soil_catalogue
    >>> entry = soil_catalogue()["comin2017/es-3"]
    >>> entry.published["friction_angle"], entry.assumed
    (0.625351, ('kc', 'shear_modulus'))
    """
    entries = {}
    for file in sorted(resources.files("soilml.physics.soils").iterdir(), key=str):
        if not file.name.endswith(".toml"):
            continue
        content = tomllib.loads(file.read_text(encoding="utf-8"))
        assumed_by_all = content.get("assumed", {})
        for key, entry in content["soil"].items():
            name = f"{file.name.removesuffix('.toml')}/{key}"
            if isinstance(entry, list):  # a row of a printed table; the last cells may be left out
                entry = dict(zip(content["columns"], entry, strict=False))
            entries[name] = _entry(name, content["source"], assumed_by_all, entry)
    return entries


def _entry(name: str, source: str, assumed: dict[str, float], entry: dict[str, Any]) -> SoilEntry:
    own_assumed = assumed | entry.get("assumed", {})
    known = {field.name for field in fields(Soil)}
    published = {key: float(value) for key, value in entry.items() if key in known}
    # a negative cohesion is an artefact of a straight line through shear tests: models use 0
    usable = {k: max(v, 0.0) if k == "cohesion" else v for k, v in published.items()}
    used = {key: value for key, value in own_assumed.items() if key not in usable}
    return SoilEntry(
        name=name,
        soil=Soil(**(used | usable)),
        source=source,
        text=entry["text"],
        assumed=tuple(sorted(used)),
        published=published,
        spread={
            key: (float(low), float(high)) for key, (low, high) in entry.get("spread", {}).items()
        },
    )


def soil(name: str, **changes: Real) -> Soil:
    """The soil `name` of the catalogue, with single values replaced by `changes`.

    Raises `InputError` for a name or a field that does not exist.

    Examples
    --------
    >>> from soilml import soil
    >>> sand = soil("wong1989/dry_sand", cohesion=500.0)  # Pa
    >>> sand.cohesion, sand.friction_angle
    (500.0, 0.488692)
    """
    catalogue = soil_catalogue()
    if name not in catalogue:
        raise InputError(
            f"no soil {name!r}; {did_you_mean(name, catalogue)}"
            "`soilml show soils` lists the catalogue"
        )
    try:
        return replace(catalogue[name].soil, **changes)
    except TypeError:
        known = {field.name for field in fields(Soil)}
        wrong = sorted(changes.keys() - known)[0]
        raise InputError(f"a soil has no {wrong!r}; it has: {', '.join(sorted(known))}") from None
