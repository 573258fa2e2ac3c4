"""Units as logs write them, and their conversion to those of soilml, by pint."""

from __future__ import annotations

import re
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from soilml.errors import InputError
from soilml.optional_imports import need, tomllib

#: Spellings in which capitals matter, because small letters mean something else.
_EXACT = {"mNm": "mN*m", "MNm": "MN*m", "Nm": "N*m", "kNm": "kN*m", "G": "g_0", "mA": "mA"}
#: Per cent of something that a data sheet states.
_SHARE = re.compile(
    r"(?:%|pct|percent|prozent)[ _]*(?:(?:of|von|vom)\b.*|rated\b.*|nominal\b.*|nenn.*|f\.?s\.?)",
    re.IGNORECASE,
)
_POWER = re.compile(r"([A-Za-z]+)\s*(?:\^|\*\*)?\s*(-?\d)(?!\d)")
#: Dimensions by the unit that soilml uses.
DIMENSIONS = (
    "s", "rad/s", "rad", "m/s", "m", "1", "N m", "A", "N", "kg", "N m/A", "m/s^2", "Pa", "m^2",
)  # fmt: skip
_ANGLES = ("deg", "rad", "turn", "rpm", "count", "mrad", "urad", "arcmin", "arcsec", "grade")
_OTHER_KIND = {
    "N": "kg are a mass; write kgf where a scale shows the force in kg, or give the mass as "
    "[vehicle] mass",
    "kg": "that is not a mass; write kg",
}


@cache
def _known() -> tuple[dict[str, str], frozenset[str]]:
    """Unit by its spelling, and units that may end a name, from the file beside this one."""
    found = tomllib.loads(Path(__file__).with_name("units.toml").read_text(encoding="utf-8"))
    known = {text: unit for unit, texts in found["spellings"].items() for text in texts}
    return known, frozenset(found["suffixes"].split())


def spelling(unit: str) -> str:
    """The unit in the spelling that pint reads; unknown units are returned with little change."""
    text = unit.strip().strip("[](){}").strip()
    if text in _EXACT:
        return _EXACT[text]
    if _SHARE.fullmatch(text):
        return "percent"
    text = text.replace("µ", "u").replace("μ", "u").replace("·", "*").replace("⋅", "*")
    text = text.replace("²", "^2").replace("⁻¹", "^-1").replace("⁻", "^-").replace("×", "*")
    known, _ = _known()
    if text.lower() in known and not (text[:1] == "M" and text.lower()[0] == "m"):
        return known[text.lower()]
    text = text.replace("°", "deg").replace("º", "deg")
    if text.lower() in known:
        return known[text.lower()]
    parts = re.split(r"([*/ ])", text)
    parts = [p if p in ("1", "-", "/", "C") else known.get(p.lower(), p) for p in parts]
    text = "".join(parts)
    text = _POWER.sub(r"\1**\2", text)
    return re.sub(r"(?<=[\w)])\s+(?=\w)", "*", text)


def unit_in_name(name: str) -> str:
    """The unit that ends a name such as torque_Nm, v_mm_s or current_mA; "" without one."""
    first, *others = re.split(r"[_\s.\-]+", name)
    words = [first, *(word for word in others if word.lower() != "per")]
    for count in (2, 1):
        tail = words[-count:]
        if count == 2 and tail[-1].lower() in ("sec", "second"):
            tail[-1] = "s"
        if len(words) > count and "_".join(tail).lower() in _known()[1]:
            text = (
                "/".join(tail)
                if count == 2 and tail[-1] in ("s", "s2", "min", "h")
                else "_".join(tail)
            )
            if len(text) == 1 and text.islower() and text in ("a", "n", "v"):
                continue  # an axis or an index rather than a unit
            return text.replace("s2", "s^2")
    return ""


def is_raw_signal(unit: str) -> bool:
    """Whether a unit is that of a sensor before its calibration: volts, mV/V, counts."""
    text = spelling(unit)
    return text in ("V", "mV", "uV", "kV", "count") or re.fullmatch(r"[mu]?V/V", text) is not None


def known_unit(text: str) -> bool:
    """Whether a text is a unit: pint reads it in the spelling of logs."""
    return len(text) <= 16 and dimension(text) is not None


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


def factor(unit: str, ours: str, where: str = "") -> float:
    """What a number in `unit` is multiplied by to be in `ours`, the unit of soilml.

    Raises `InputError`, beginning with `where`, for a text that is not a unit and for a unit of
    another kind.
    """
    if unit == "":
        return 1.0
    where = f"{where}: " if where else ""
    if ours == "Hz" and spelling(unit) in ("Hz", "kHz", "1/s", "s**-1"):
        return 1e3 if spelling(unit) == "kHz" else 1.0
    quantity = _parsed(unit)
    shown = {"1": "a plain number or %"}.get(ours, ours)
    if quantity is None:
        raise InputError(f"{where}unit {unit!r} is not known; needed is one that gives {shown}")
    kind = dimension(unit)
    if kind == "1" and ours == "1":
        return float(quantity.to("dimensionless").magnitude)
    if kind != ours and not (
        kind == "1" and ours in ("rad", "rad/s") and spelling(unit) != "percent"
    ):
        hint = _OTHER_KIND.get(ours, "") if {kind, ours} == {"N", "kg"} else ""
        if kind in ("count", "count/s"):
            hint = "counts of an encoder need counts_per_turn, in [wheel_angle] or [wheel_speed]"
        raise InputError(f"{where}unit {unit!r} does not give {shown}{'; ' + hint if hint else ''}")
    text = spelling(unit)
    if text in ("Hz", "kHz") and ours == "rad/s":
        return 6.283185307179586 * (1e3 if text == "kHz" else 1.0)
    return float(quantity.to(_parsed_ours(ours).units).magnitude)
