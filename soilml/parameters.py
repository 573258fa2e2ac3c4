"""Parameters: declared once with their field, addressed by dotted path.

A field of a frozen dataclass becomes a parameter by its annotation,

    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6)]

and is then found by `values`, replaced by `with_values` and validated by `check`, however deep it
sits in a tree of dataclasses, tuples of named parts, and plain mappings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, TypeVar, get_type_hints

import numpy as np

from soilml.arrays import Real, to_numpy
from soilml.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Parameter:
    """Unit and closed bounds of a number, and what it means."""

    unit: str
    lower: float
    upper: float
    text: str = ""


def declared(cls: type) -> dict[str, Parameter]:
    """The parameters that a dataclass declares, by field name, in order."""
    return _declared(cls)


@cache
def _declared(cls: type) -> dict[str, Parameter]:
    hints = get_type_hints(cls, include_extras=True)
    parameters = {}
    for field in fields(cls):
        for mark in getattr(hints[field.name], "__metadata__", ()):
            if isinstance(mark, Parameter):
                parameters[field.name] = mark
    return parameters


@cache
def _field_names(cls: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(cls))


@cache
def _part_fields(cls: type) -> tuple[str, ...]:
    """Names of the fields of a dataclass that are no parameters."""
    own = declared(cls)
    return tuple(name for name in _field_names(cls) if name not in own)


def _is_node(cls: Any) -> bool:
    """Whether instances of a class are dataclasses."""
    return hasattr(cls, "__dataclass_fields__")


def _parts(tree: Any) -> Iterator[tuple[str, str | int, Any]]:
    """(path name, key, part) of the parts of `tree` that may hold parameters."""
    cls: type = type(tree)
    if _is_node(cls):
        for name in _part_fields(cls):
            part = getattr(tree, name)
            if isinstance(part, tuple) or _is_node(type(part)):
                yield name, name, part
    elif isinstance(tree, tuple):
        for index, part in enumerate(tree):
            if hasattr(part, "name"):
                yield part.name, index, part


def located(tree: Any, prefix: str = "") -> dict[str, tuple[Parameter, Real]]:
    """Every parameter of the tree that has a value, dotted path -> (declaration, value)."""
    found: dict[str, tuple[Parameter, Real]] = {}
    if _is_node(type(tree)):
        for name, parameter in declared(type(tree)).items():
            if (value := getattr(tree, name)) is not None:
                found[prefix + name] = parameter, value
    for name, _, part in _parts(tree):
        found |= located(part, f"{prefix}{name}.")
    return found


def values(tree: Any) -> dict[str, Real]:
    """Every parameter's value, by dotted path."""
    return {path: value for path, (_, value) in located(tree).items()}


def mapped(tree: T, change: Callable[[Any], Real]) -> T:
    """The same tree with every parameter's value replaced by what `change` makes of it.

    Dataclasses do not check their fields again: values change their type, or lose rows.
    """
    changed: dict[str | int, Any] = {}
    if _is_node(type(tree)):
        for name in declared(type(tree)):
            old = getattr(tree, name)
            if old is not None and (new := change(old)) is not old:
                changed[name] = new
    for _, key, part in _parts(tree):
        if (new := mapped(part, change)) is not part:
            changed[key] = new
    if not changed:
        return tree
    whole: T = _with_elements(tree, changed) if isinstance(tree, tuple) else _copied(tree, changed)
    return whole


def _copied(tree: Any, changed: Mapping[Any, Any]) -> Any:
    """A dataclass with some fields replaced, without its checks."""
    cls: Any = type(tree)
    copy = object.__new__(cls)
    for name in _field_names(cls):
        object.__setattr__(copy, name, changed[name] if name in changed else getattr(tree, name))
    return copy


def with_values(tree: T, new: Mapping[str, Real]) -> T:
    """The same tree with some parameters replaced; a path that the tree lacks raises `InputError`.

    Values are not checked: inside a computation an effect may carry a parameter past its bounds.
    """
    if missing := new.keys() - located(tree).keys():
        raise InputError(
            f"no parameter {sorted(missing)[0]!r}; there are: {', '.join(located(tree))}"
        )
    return _rebuilt(tree, new) if new else tree


def _rebuilt(tree: Any, new: Mapping[str, Real]) -> Any:
    here = {path: value for path, value in new.items() if "." not in path}
    changed: dict[str | int, Any] = dict(here.items())
    for name, key, part in _parts(tree):
        inner = {
            path[len(name) + 1 :]: value
            for path, value in new.items()
            if path.startswith(f"{name}.")
        }
        if inner:
            changed[key] = _rebuilt(part, inner)
    if isinstance(tree, tuple):
        return _with_elements(tree, changed)
    return replace(tree, **{str(key): value for key, value in changed.items()})


def _with_elements(tree: tuple[Any, ...], changed: Mapping[Any, Any]) -> Any:
    """A tuple with some elements replaced."""
    return tuple(changed.get(index, part) for index, part in enumerate(tree))


def check(tree: Any, where: str = "") -> None:
    """Raise `InputError` where a parameter is no number or lies outside its bounds."""
    for path, (parameter, value) in located(tree).items():
        check_number(where + path, parameter, value)


def check_number(path: str, parameter: Parameter, value: Any) -> None:
    """Raise `InputError` where a value is no number or lies outside the bounds of its parameter."""
    if type(value) is float and parameter.lower <= value <= parameter.upper:
        return
    numbers = as_numbers(path, value)
    bad = ~((numbers >= parameter.lower) & (numbers <= parameter.upper))
    if bad.any():
        worst = float(numbers[bad].flat[0]) if numbers.ndim else float(numbers)
        raise InputError(
            f"{path} is {worst:g} {unit_text(parameter.unit)}".rstrip()
            + f"; it must lie {_range_text(parameter)}"
            + _hint(parameter, worst)
        )


def as_numbers(path: str, value: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The value as numbers; raises `InputError` for text, ragged lists and masked arrays."""
    try:
        if not isinstance(value, str | bytes | np.ma.MaskedArray):
            return to_numpy(value)
    except (TypeError, ValueError, OverflowError):
        pass
    shown = f"{value!r:.60}".splitlines()[0]
    raise InputError(f"{path} is {shown}; needed is a number, or an array of numbers")


def _range_text(parameter: Parameter) -> str:
    """The bounds in words; those a hair inside a whole number exclude it."""
    lower, upper = parameter.lower, parameter.upper
    open_ends = (round(lower) != lower) and f"{lower:.6g}" == f"{round(lower):g}"
    return f"between {lower:.6g} and {upper:.6g}" + (", these excluded" if open_ends else "")


def unit_text(unit: str) -> str:
    """The unit as printed behind a number: nothing for a pure number."""
    return "" if unit == "1" else unit


def _hint(parameter: Parameter, value: float) -> str:
    if parameter.unit == "rad" and 2.0 <= value <= 90.0:
        return f" (if {value:g} are degrees, write {np.deg2rad(value):.4f})"
    return ""
