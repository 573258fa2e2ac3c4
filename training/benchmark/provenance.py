"""Provenance: whether a model file, test data and estimators share one wheel, soil and prior."""

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

#: Relative tolerance of values that should be equal: measured dimensions of the wheel, and others.
DIMENSION_TOLERANCE, VALUE_TOLERANCE = 0.005, 0.001


def check_same_provenance(
    case: Case, table: Table, estimators: Mapping[str, Estimator], names: Sequence[str]
) -> list[str]:
    """Compare the recipes of test data and estimators with a case.

    Test data and estimators without a recipe are not checked.

    Parameters
    ----------
    case
        The model file.
    table
        The test data, with their recipe in its metadata.
    estimators
        Estimators by label, each with the recipe of its training data in its metadata.
    names
        The parameters compared, whose priors must agree.

    Returns
    -------
    list of str
        One note for each difference between the case and the training data of an estimator in
        soil, effects or prior: such an estimator is compared nevertheless.

    Raises
    ------
    InputError
        Where the test data differ from the case, or an estimator is of another wheel.
    """
    test = _recipe(table.metadata.get("soilml_recipe", "{}"), table.source)
    trained = {label: _recipe(e.metadata["recipe"], e.path) for label, e in estimators.items()}
    for label, other in ({table.source: test} | trained).items():
        for difference in _gear_differences(case, other) if other else ():
            raise InputError(f"{label} is of {difference}: compare data and models of one wheel")
    for difference in _differences(case, test, names) if test else ():
        raise InputError(
            f"{table.source} has {difference}: use the model file that the data were made with"
        )
    return [
        f"{label} was trained with {difference}"
        for label, other in trained.items()
        for difference in (_differences(case, other, names) if other else ())
    ]


def _recipe(text: str, source: str) -> Case | None:
    """The case in a recipe; None where there is no recipe."""
    try:
        content = json.loads(text, parse_int=float)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise InputError(f"{source}: its recipe is damaged; generate or train the file again")
    return take_case(Settings(content, f"recipe of {source}", Path())) if content else None


def _gear_differences(case: Case, other: Case) -> Iterator[str]:
    """Type and dimensions of the other's gear that differ from the case's."""
    own_type, other_type = _gear_type(case), _gear_type(other)
    if own_type != other_type:
        yield f"a gear of type {other_type!r}, the model file of type {own_type!r}"
    others = other.parameters()
    for path, (_, value) in case.parameters().items():
        if path.startswith("gear.") and not _close(value, others[path][1], DIMENSION_TOLERANCE):
            name = path.removeprefix("gear.")
            yield f"a wheel with {name} {others[path][1]:g}, the model file has {value:g}"


def _gear_type(case: Case) -> str:
    return next(name for name, cls in GEARS.items() if type(case.model.gear) is cls)


def _differences(case: Case, other: Case, names: Sequence[str]) -> Iterator[str]:
    """Effects, fixed values and priors of the other that differ from the case's."""
    own_effects, other_effects = ({e.name for e in c.model.effects} for c in (case, other))
    if own_effects != other_effects:
        yield f"effects {_list(other_effects)}, the model file {_list(own_effects)}"
    others = other.parameters()
    for path, (_, value) in case.parameters().items():
        # a parameter that the other varies has no one value
        fixed = path in others and path not in other.prior and not path.startswith("gear.")
        if fixed and not _close(value, others[path][1], VALUE_TOLERANCE):
            yield f"{path} {others[path][1]:g}, the model file {value:g}"
    for name in names:
        own, its = case.prior.get(name), other.prior.get(name)
        if own is None:
            continue
        if its is None:
            yield f"no prior of {name}, the model file {own.as_setting()}"
        elif own.log != its.log or not (
            _close(own.lower, its.lower, VALUE_TOLERANCE)
            and _close(own.upper, its.upper, VALUE_TOLERANCE)
        ):
            yield f"prior {its.as_setting()} of {name}, the model file {own.as_setting()}"


def _close(a: float, b: float, tolerance: float) -> bool:
    return abs(a - b) <= tolerance * max(abs(a), abs(b))


def _list(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"
