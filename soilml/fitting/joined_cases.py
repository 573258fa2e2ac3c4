"""Several cases, each with sets of values and operating points, as one batch of rows."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from itertools import pairwise
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.parameters import Parameter, check, check_number, located, mapped
from soilml.parameters import values as parameter_values
from soilml.physics.contact import Resolution
from soilml.physics.effects.base import Effect
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import COVARIATES, Operating


@dataclass(frozen=True)
class CaseSets:
    """A case, `sets` values of some of its parameters by path, and n operating points for each."""

    case: Case
    sets: int
    values: Mapping[str, Floats]  # (sets,)
    at: Operating

    @property
    def points(self) -> int:
        """Number n of operating points."""
        return int(np.size(self.at.slip))


#: So few rows are solved in one call whatever the stresses: a call costs more than the rows.
FEW_ROWS = 1000


def join_keys(parts: Sequence[CaseSets]) -> list[Hashable]:
    """A key of each part, equal for those that `joined_load_case` may join at little cost.

    They share gear, known covariates and the effects that multiply the points of a contact. Effects
    on stresses act at all points of every contact, so that rows without such an effect are kept
    apart from those that have it, unless there are few.
    """
    few = sum(part.sets * part.points for part in parts) < FEW_ROWS
    keys: list[Hashable] = []
    for part in parts:
        known = tuple(name for name in COVARIATES if getattr(part.at, name) is not None)
        effects = part.case.model.effects
        multiplied = frozenset(e.name for e in effects if e.more_points)
        on_stress = frozenset(e.name for e in effects if e.overrides("on_stress") and not few)
        keys.append((part.case.model.gear, known, multiplied, on_stress))
    return keys


def joined_load_case(parts: Sequence[CaseSets]) -> LoadCase:
    """The rows of all parts, in order: operating points within sets within parts.

    The effects are those of all cases, in an order that each case has; an effect that a case lacks
    has its neutral parameters in its rows, and so changes nothing there.

    Raises `InputError` for a value outside its bounds; `graphlib.CycleError` where two cases have
    the same effects in contrary order.
    """
    cases = list({id(part.case): part.case for part in parts}.values())
    effects = _joined_effects(cases)
    neutral: dict[str, Any] = {}
    for effect in effects.values():
        neutral |= _neutral_parameters(effect)  # type: ignore[arg-type]  # a class is hashable
    sets = np.asarray([part.sets for part in parts])
    points = np.asarray([part.points for part in parts])
    set_ends = np.cumsum(sets)
    set_of_row = np.repeat(np.arange(set_ends[-1]), np.repeat(points, sets))
    known = {id(case): neutral | case.numbers for case in cases}
    varied = {path for part in parts for path in part.values}
    first, *others = known.values()
    varying: dict[str, tuple[Parameter, Floats]] = {}  # to be checked together

    def number(path: str, shown: str, parameter: Parameter) -> Floats:
        """The value of a parameter in all rows; a checked one of shape () where they share it."""
        value = first[path]
        if path not in varied and all(own[path] == value for own in others):
            check_number(shown, parameter, value)
            return np.asarray(value, dtype=np.float64)
        by_set = np.empty(set_ends[-1])
        for part, end in zip(parts, set_ends, strict=True):
            own = known[id(part.case)][path]
            by_set[end - part.sets : end] = part.values.get(path, own)
        varying[shown] = parameter, by_set
        return np.asarray(by_set[set_of_row])

    at = _joined_operating(parts)
    check(at)
    model = cases[0].model
    own_effects = {effect.name: effect for effect in model.effects}
    joined_effects = tuple(own_effects.get(name, effect()) for name, effect in effects.items())
    joined = LoadCase(model.gear, cases[0].soil, at, joined_effects, Resolution.FIT)
    numbers: list[Any] = []
    for path, (parameter, value) in located(joined).items():
        part, _, name = path.partition(".")
        if part == "at":
            numbers.append(value)
        elif part == "soil":
            numbers.append(number(name, f"soil {name}", parameter))
        else:
            numbers.append(number(path.removeprefix("effects."), path, parameter))
    _check_together(varying)
    in_order = iter(numbers)
    return mapped(joined, lambda _: next(in_order))


def _check_together(varying: Mapping[str, tuple[Parameter, Floats]]) -> None:
    """Check values (sets,) of parameters, by the names of messages; see `check_number`."""
    if not varying:
        return
    lower, upper = np.asarray([(own.lower, own.upper) for own, _ in varying.values()]).T[:, :, None]
    together = np.stack([own for _, own in varying.values()])
    if not np.all((together >= lower) & (together <= upper)):
        for shown, (parameter, own) in varying.items():
            check_number(shown, parameter, own)


@cache
def _neutral_parameters(effect: type[Effect]) -> dict[str, Any]:
    """The parameters of an effect, by path, at which it changes nothing."""
    return {f"{effect.name}.{path}": value for path, value in parameter_values(effect()).items()}


def _joined_effects(cases: Sequence[Case]) -> dict[str, type[Effect]]:
    """The effects of all cases by name, in an order that each case has."""
    order: TopologicalSorter[str] = TopologicalSorter()
    effects: dict[str, type[Effect]] = {}
    for case in cases:
        effects |= {effect.name: type(effect) for effect in case.model.effects}
        names = [effect.name for effect in case.model.effects]
        for name in names:
            order.add(name)
        for earlier, later in pairwise(names):
            order.add(later, earlier)
    return {name: effects[name] for name in order.static_order()}


def _joined_operating(parts: Sequence[CaseSets]) -> Operating:
    """The operating points of all rows."""
    known: dict[str, Floats] = {}
    for name in ("slip", "load", *COVARIATES):
        if getattr(parts[0].at, name) is not None:
            columns: list[Floats] = []
            for part in parts:
                column = getattr(part.at, name)
                columns += [np.broadcast_to(column, part.points)] * part.sets
            known[name] = np.concatenate(columns)
    return Operating(**known)
