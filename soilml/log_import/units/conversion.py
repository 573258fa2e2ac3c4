"""Conversion of the units of a log to those of soilml, by pint."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from soilml.errors import InputError
from soilml.log_import.units.unit_names import spelling
from soilml.optional_imports import need

#: Dimensions by the unit that soilml uses.
DIMENSIONS = (
    "s",
    "rad/s",
    "rad",
    "m/s",
    "m",
    "1",
    "N m",
    "A",
    "N",
    "kg",
    "N m/A",
    "m/s^2",
    "Pa",
    "m^2",
)
_ANGLES = ("deg", "rad", "turn", "rpm", "count", "mrad", "urad", "arcmin", "arcsec", "grade")
_OTHER_KIND = {
    "N": "kg are a mass; write kgf where a scale shows the force in kg, or give the mass as "
    "[vehicle] mass",
    "kg": "that is not a mass; write kg",
}


@lru_cache(maxsize=1)
def _registry() -> Any:
    need("pint", "import")
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=512)
def _parsed(unit: str) -> Any:
    """A quantity of size 1 of this unit, or None for a text that is not a unit."""
    text = spelling(unit)
    if not text or text[0].isdigit():
        return None
    registry = _registry()
    try:
        return registry.Quantity(1.0, registry.parse_units(text.replace("/1000", ""))) * (
            1e-3 if text.endswith("/1000") else 1.0
        )
    except Exception:  # pint raises a dozen kinds, tokenizer errors among them
        return None


@lru_cache(maxsize=512)
def dimension(unit: str) -> str | None:
    """The unit of soilml that a unit can be converted to; "count", "count/s"; None for no unit.

    Angles are no plain numbers: degrees are "rad", per cent are "1". A unit of another dimension
    (V, degC) is "other".
    """
    quantity = _parsed(unit)
    if quantity is None:
        return None
    text = spelling(unit)
    if "count" in text:
        return "count/s" if "/s" in text else "count"
    is_angle = any(word in text.replace("radius", "") for word in _ANGLES) or text in ("Hz", "kHz")
    for name in DIMENSIONS:
        ours = _parsed_ours(name)
        if quantity.dimensionality == ours.dimensionality and is_angle == ("rad" in name):
            return name
    return "other"


def _parsed_ours(unit: str) -> Any:
    registry = _registry()
    text = {"1": "dimensionless", "N m": "N*m", "N m/A": "N*m/A"}.get(unit, unit)
    return registry.Quantity(1.0, text)


def factor(unit: str, ours: str, where: str) -> float:
    """What a number in `unit` is multiplied by to be in `ours`, the unit of soilml.

    Raises `InputError`, beginning with `where`, for a text that is not a unit and for a unit of
    another kind.
    """
    if unit == "":
        return 1.0
    if ours == "Hz" and spelling(unit) in ("Hz", "kHz", "1/s", "s**-1"):
        return 1e3 if spelling(unit) == "kHz" else 1.0
    quantity = _parsed(unit)
    shown = {"1": "a plain number or %"}.get(ours, ours)
    if quantity is None:
        raise InputError(f"{where}: unit {unit!r} is not known; needed is one that gives {shown}")
    kind = dimension(unit)
    if kind == "1" and ours == "1":
        return float(quantity.to("dimensionless").magnitude)
    if kind != ours and not (
        kind == "1" and ours in ("rad", "rad/s") and spelling(unit) != "percent"
    ):
        hint = _OTHER_KIND.get(ours, "") if {kind, ours} == {"N", "kg"} else ""
        if kind in ("count", "count/s"):
            hint = "counts of an encoder need counts_per_turn, in [wheel_angle] or [wheel_speed]"
        raise InputError(
            f"{where}: unit {unit!r} does not give {shown}{'; ' + hint if hint else ''}"
        )
    text = spelling(unit)
    if text in ("Hz", "kHz") and ours == "rad/s":
        return 6.283185307179586 * (1e3 if text == "kHz" else 1.0)
    return float(quantity.to(_parsed_ours(ours).units).magnitude)
