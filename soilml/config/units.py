"""Values with units, such as "33 deg" or "8 kPa", in SI units."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from typing import Any

from soilml.errors import InputError
from soilml.io.toml_settings import Settings

#: Size of each unit in the SI unit that a parameter is declared in.
UNITS: dict[str, dict[str, float]] = {
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "m/N": {"m/N": 1.0, "mm/N": 1e-3},
    "Pa/m": {"Pa/m": 1.0, "kPa/m": 1e3, "MPa/m": 1e6},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6},
    "N": {"N": 1.0, "kN": 1e3},
    "N m": {"N m": 1.0, "Nm": 1.0, "mNm": 1e-3, "mN m": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "m/s^2": {"m/s^2": 1.0},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    "N/m^2": {"N/m^2": 1.0, "kN/m^2": 1e3},
    "N/m^3": {"N/m^3": 1.0, "kN/m^3": 1e3},
    "N/m^(n+1)": {"N/m^(n+1)": 1.0, "kN/m^(n+1)": 1e3},
    "N/m^(n+2)": {"N/m^(n+2)": 1.0, "kN/m^(n+2)": 1e3},
    "1": {"%": 1e-2},
}
_VALUE = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*")


def take_quantity(settings: Settings, key: str, unit: str) -> float:
    """The value of `key` in a parameter's SI unit: a number, or a text with a unit.

    >>> from pathlib import Path
    >>> settings = Settings({"friction_angle": "33 deg"}, "model.toml [soil]", Path())
    >>> round(take_quantity(settings, "friction_angle", "rad"), 4)
    0.576
    """
    value = settings.take(key, (int, float, str), _number(unit))
    return in_si(settings, key, value, unit)


def in_si(settings: Settings, key: str, value: Any, unit: str) -> float:
    """A number, or a text with a unit, in the SI unit `unit`; `InputError` for another value."""
    if not isinstance(value, str):
        return float(value)
    return text_in_si(value, unit, f"{settings.where}: {key}")


def text_in_si(text: str, unit: str, what: str) -> float:
    """The value of a text with a unit, in the SI unit `unit`.

    Raises `InputError`, beginning with `what` it is of, for another text.
    """
    known = UNITS.get(unit, {})
    match = _VALUE.fullmatch(text)
    if match is not None and match[2] in known:
        with suppress(ValueError):
            return float(match[1]) * known[match[2]]
    units = f", or a text with one of the units {', '.join(known)}" if known else ""
    raise InputError(f"{what} is {text!r}; needed is {_number(unit)}{units}")


def _number(unit: str) -> str:
    return "a number" if unit == "1" else f"a number in {unit}"
