"""Values of a map with unit and standard deviation: `\"38.5 mN m/A +- 3 %\"`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from soilml.io.cell_text import read_number
from soilml.io.toml_settings import Settings
from soilml.log_import.units import factor

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_FORM = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*(?:(?:\+-|\+/-|±)\s*({_NUMBER})\s*(.*?))?\s*")


@dataclass(frozen=True)
class Uncertain:
    """A value in the unit of soilml, and its standard deviation; 0 where it is exact."""

    value: float
    std: float = 0.0

    @property
    def relative(self) -> float:
        """Standard deviation as a share of the value."""
        return self.std / abs(self.value) if self.value else 0.0

    def times(self, share: float) -> Uncertain:
        """The value and its standard deviation, multiplied."""
        return Uncertain(share * self.value, share * self.std)


@dataclass(frozen=True)
class UncertainIn:
    """A number or a text such as `"0.15 m +- 1 %"`, above `above`; without its error if `exact`."""

    unit: str
    above: float = -math.inf
    exact: bool = False

    def take(self, settings: Settings, key: str, kind: str) -> Any:
        """The value; raises `InputError` for a wrong form and for one that is too small."""
        example = f"'0.15 {self.unit} +- 1 %'" if self.unit != "1" else "'0.7 +- 0.05'"
        needed = f"a number in {self.unit}, or a text such as {example}"
        given = settings.take(key, (int, float, str), needed)
        found = parse_uncertain(given, self.unit, f"{settings.where} {key}")
        if found is None or found.std < 0.0:
            settings.fail(f"{key} is {given!r}; needed is {needed}")
        if not found.value > self.above:
            settings.fail(f"{key} is {given!r}; needed is a value above {self.above:g}")
        return found.value if self.exact else found


def parse_uncertain(text: str | int | float, ours: str, where: str) -> Uncertain | None:
    """A number, or a text such as `"0.15 m +- 1 %"`; None for another form.

    The standard deviation is in the value's own unit, in another one, or in per cent of the value.
    Raises `InputError` for a unit that does not give `ours`.
    """
    if not isinstance(text, str):
        return Uncertain(float(text)) if math.isfinite(text) else None
    match = _FORM.fullmatch(text)
    if match is None:
        return None
    try:
        number, std = read_number(match[1]), read_number(match[3] or "0")
    except ValueError:  # more than a number can hold
        return None
    scale, unit = factor(match[2], ours, where), match[4]
    value = number * scale
    if match[3] is None:
        return Uncertain(value)
    if unit == "%" and match[2] != "%":
        return Uncertain(value, std / 100.0 * abs(value))
    return Uncertain(value, std * (factor(unit, ours, where) if unit else scale))
