"""Tables of settings read by their declaration: the fields of a dataclass are the keys of a table.

A field says by its type what a key holds: a text, `true` or `false`, a whole number, another
dataclass (a table), a tuple of dataclasses (tables in a list), or a mapping of names to dataclasses
(named tables). A `Parameter` is a number in its unit, within its bounds. Whatever else stands in
`Annotated` with a method `take` reads the key itself.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from soilml.errors import InputError
from soilml.io.toml_settings import Settings
from soilml.parameters import Parameter, check_number

T = TypeVar("T")

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
    "1/m": {"1/m": 1.0, "1/mm": 1e3},
    "1/Pa": {"1/Pa": 1.0, "1/kPa": 1e-3, "1/MPa": 1e-6},
    "1": {"%": 1e-2},
}
_VALUE = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*")


def take_quantity(settings: Settings, key: str, unit: str) -> float:
    """The value of `key` in a parameter's SI unit: a number, or a text with a unit.

    >>> settings = Settings({"friction_angle": "33 deg"}, "model.toml [soil]")
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


@dataclass(frozen=True)
class Key:
    """The key of a field, where it is not the field's name."""

    name: str


@dataclass(frozen=True)
class For:
    """A field that only tables of some kinds have, such as channels of some roles."""

    kinds: tuple[str, ...]


@dataclass(frozen=True)
class OneOf:
    """A text that is one of some."""

    options: tuple[str, ...]

    def take(self, settings: Settings, key: str, kind: str) -> str:
        """The option, whatever the white space in it."""
        given = settings.text(key)
        plain = {known.replace(" ", ""): known for known in self.options}
        if given.replace(" ", "") not in plain:
            shown = ", ".join(repr(known) for known in self.options if known)
            settings.fail(f"{key} is {given!r}; needed is one of {shown}")
        return plain[given.replace(" ", "")]


@dataclass(frozen=True)
class Pattern:
    """A regular expression with so many groups, fewest and most; `what` group 1 is."""

    groups: tuple[int, int]
    what: str

    def take(self, settings: Settings, key: str, kind: str) -> re.Pattern[str]:
        """The expression, for letters of any case."""
        text = settings.text(key)
        try:
            found = re.compile(text, re.IGNORECASE)
        except re.error as error:
            settings.fail(f"{key} {text!r} is no regular expression: {error}")
        low, high = self.groups
        if not low <= found.groups <= high:
            many = "one group in brackets" if low else "at most one group"
            settings.fail(f"{key} is {text!r}; needed is {many}, {self.what}")
        return found


@dataclass(frozen=True)
class Numbers:
    """A list of so many finite numbers, each within bounds; a text in `also` may stand instead."""

    needed: str
    count: int
    lower: float = -math.inf
    upper: float = math.inf
    rising: bool = False
    ordered: bool = False  # Rising, or equal
    also: tuple[str, ...] = ()

    def take(self, settings: Settings, key: str, kind: str) -> Any:
        """The numbers (count,), or the text."""
        given = settings.take(key, (str, list) if self.also else list, self.needed)
        if given in self.also:
            return given
        numbers = [x for x in given if isinstance(x, int | float) and not isinstance(x, bool)]
        right = isinstance(given, list) and len(numbers) == len(given) == self.count
        if not right or not all(math.isfinite(x) and self.lower <= x <= self.upper for x in given):
            settings.fail(f"{key} is {given!r}; needed is {self.needed}")
        wrong = (self.rising and given[0] >= given[1]) or (self.ordered and given[0] > given[1])
        if wrong:
            settings.fail(f"{key} is {given!r}; needed is {self.needed}, the lower one first")
        return tuple(float(x) for x in given)


def _declarations(cls: Any) -> list[tuple[str, str, Any, tuple[Any, ...], bool]]:
    """Field, key, type, marks, and whether the key must be there, of each field of a dataclass."""
    hints = get_type_hints(cls, include_extras=True)
    found = []
    for field in fields(cls):
        hint: Any = hints[field.name]
        marks: tuple[Any, ...] = ()
        if hasattr(hint, "__metadata__"):
            hint, marks = hint.__origin__, hint.__metadata__
        key = next((mark.name for mark in marks if isinstance(mark, Key)), field.name)
        needed = field.default is MISSING and field.default_factory is MISSING
        found.append((field.name, key, hint, marks, needed))
    return found


def settings_of(given: Any) -> dict[str, Any]:
    """The table that `take_declared` reads as this dataclass; None and "" are not written."""
    values = {key: getattr(given, name) for name, key, *_ in _declarations(type(given))}
    return {key: value for key, value in values.items() if value is not None and value != ""}


def take_declared(cls: type[T], settings: Settings, kind: str = "", **given: Any) -> T:
    """A dataclass from the table of its keys.

    kind: Which fields with `For` the table has, such as the role of a channel.
    given: Fields that are no keys of the table.

    Raises `InputError`, naming file, table and key, for what is missing, unknown or out of bounds,
    and with the table before what the dataclass itself refuses.
    """
    values = dict(given)
    for name, key, hint, marks, needed in _declarations(cls):
        wanted = [mark.kinds for mark in marks if isinstance(mark, For)]
        if name in given or any(kind not in kinds for kinds in wanted):
            continue
        if key in settings or needed:
            values[name] = _taken(settings, key, hint, marks, kind)
        settings.permit([key])
    settings.finish()
    try:
        return cls(**values)
    except InputError as error:
        settings.fail(str(error))


def _taken(settings: Settings, key: str, hint: Any, marks: tuple[Any, ...], kind: str) -> Any:
    for mark in marks:
        if hasattr(mark, "take"):
            return mark.take(settings, key, kind)
    for mark in marks:
        if isinstance(mark, Parameter):
            value = settings.count(key) if hint is int else take_quantity(settings, key, mark.unit)
            check_number(f"{settings.where}: {key}", mark, value)
            return value
    inner = get_args(hint)
    if is_dataclass(hint):
        return take_declared(hint, settings.table(key), kind)  # type: ignore[arg-type]
    if get_origin(hint) is tuple:
        return tuple(take_declared(inner[0], table, kind) for table in settings.tables(key))
    if get_origin(hint) in (dict, Mapping):
        return named_tables(settings, key, inner[1], kind)
    if hint is bool:
        return settings.take(key, bool, "true or false")
    if hint is float:
        return settings.number(key)
    return settings.count(key) if hint is int else settings.text(key)


def named_tables(settings: Settings, key: str, cls: type[T], kind: str = "") -> dict[str, T]:
    """The tables [key.NAME] by name; the dataclass may have a field `name`."""
    tables = settings.table(key)
    named = [key for _, key, *_ in _declarations(cls) if key == "name"]
    return {
        name: take_declared(cls, tables.table(name), kind, **dict.fromkeys(named, name))
        for name in tables.content
    }
