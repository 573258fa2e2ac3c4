"""Units, symbols and number formats that the benchmark's tables and figures share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from soilml.quantities import QUANTITIES, SHEAR

#: Display unit by SI unit: the factor that an SI value is multiplied by, and the unit's symbol.
_DISPLAY_UNITS = {"Pa": (1e-3, "kPa"), "rad": (180.0 / math.pi, "deg"), "m": (1e3, "mm")}


def display_unit(name: str) -> tuple[float, str]:
    """Factor from SI to the display unit of a quantity, and the unit's symbol."""
    unit = QUANTITIES[name].unit
    return _DISPLAY_UNITS.get(unit, (1.0, unit))


#: Display units and symbols of the shear parameters: cohesion, friction angle, shear modulus.
SHEAR_UNITS = tuple(display_unit(name) for name in SHEAR)
SHEAR_SYMBOLS = ("c", "phi", "K")


def format_number(value: float, form: str) -> str:
    """The number in a format; NaN gives a blank cell."""
    return "" if math.isnan(value) else format(value, form)


def columns_of_rows(rows: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows with equal keys as columns, in the order of the keys."""
    columns: dict[str, list[Any]] = {}
    for row in rows:
        for key, value in row.items():
            columns.setdefault(key, []).append(value)
    return columns
