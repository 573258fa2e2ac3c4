"""Whether a model file, test data and trained models are of one wheel, soil and prior."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from soilml.config.case import Case, take_case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.onboard.estimator import Estimator
from soilml.physics.gears import GEARS

#: Relative difference of two values that are meant to be one: of a size measured, and of others.
OF_SIZES, OF_OTHERS = 0.005, 0.001


def check_same_provenance(
    case: Case, table: Table, estimators: Mapping[str, Estimator], names: Sequence[str]
) -> list[str]:
    """Raise `InputError` where the test data are not of the case, or a model is of another wheel.

    Both tell what they are of by their recipe; without one nothing is checked. A model that was
    trained on another soil, other effects or another prior may be compared: how it fares then is
    worth knowing; that it was is returned, in words. `names` are the parameters compared.
    """
    test = _recipe(table.metadata.get("soilml_recipe", "{}"), table.source)
    others = {label: _recipe(e.metadata["recipe"], e.path) for label, e in estimators.items()}
    for label, other in ({table.source: test} | others).items():
        for said in _gears(case, other) if other else ():
            raise InputError(f"{label} is of {said}: compare what belongs to one wheel")
    for said in _differences(case, test, names) if test else ():
        raise InputError(f"{table.source} has {said}: give the model file that belongs to it")
    return [
        f"{label} was trained with {said}"
        for label, other in others.items()
        for said in (_differences(case, other, names) if other else ())
    ]


def _recipe(text: str, where: str) -> Case | None:
    """The case in a recipe; None where there is no recipe."""
    try:
        content = json.loads(text, parse_int=float)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise InputError(f"{where}: its recipe is damaged; generate or train it again")
    return take_case(Settings(content, f"recipe of {where}", Path())) if content else None


def _gears(case: Case, other: Case) -> Iterator[str]:
    """What wheel the other has, where it is another."""
    own, its = _kind(case), _kind(other)
    if own != its:
        yield f"a gear of type {its!r}, the model file of {own!r}"
    sizes = other.parameters()
    for path, (_, size) in case.parameters().items():
        if path.startswith("gear.") and not _near(size, sizes[path][1], OF_SIZES):
            name = path.removeprefix("gear.")
            yield f"a wheel with {name} {sizes[path][1]:g}, the model file has {size:g}"


def _kind(case: Case) -> str:
    return next(name for name, kind in GEARS.items() if type(case.model.gear) is kind)


def _differences(case: Case, other: Case, names: Sequence[str]) -> Iterator[str]:
    """What the other has, where it is not what the case has; what it varies has no value."""
    own, its = ({e.name for e in c.model.effects} for c in (case, other))
    if own != its:
        yield f"effects {_list(its)}, the model file {_list(own)}"
    values = other.parameters()
    for path, (_, value) in case.parameters().items():
        fixed = path in values and path not in other.prior and not path.startswith("gear.")
        if fixed and not _near(value, values[path][1], OF_OTHERS):
            yield f"{path} {values[path][1]:g}, the model file {value:g}"
    for name in names:
        mine, yours = case.prior.get(name), other.prior.get(name)
        if mine is None:
            continue
        if yours is None:
            yield f"no prior of {name}, the model file {mine.as_setting()}"
        elif mine.log != yours.log or not (
            _near(mine.lower, yours.lower, OF_OTHERS) and _near(mine.upper, yours.upper, OF_OTHERS)
        ):
            yield f"prior {yours.as_setting()} of {name}, the model file {mine.as_setting()}"


def _near(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))


def _list(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"
