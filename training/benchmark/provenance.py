"""Provenance: whether a model file, test data and estimators share one wheel, soil and prior."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from soilml.config.case import Case
from soilml.config.compatibility import (
    effect_differences,
    gear_differences,
    prior_differences,
    recipe_case,
    value_differences,
)
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator


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
    test = recipe_case(table.metadata.get("soilml_recipe", "{}"), table.source)
    trained = {label: recipe_case(e.metadata["recipe"], e.path) for label, e in estimators.items()}
    for label, other in ({table.source: test} | trained).items():
        for difference in gear_differences(case, other) if other else ():
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


def _differences(case: Case, other: Case, names: Sequence[str]) -> Iterator[str]:
    yield from effect_differences(case, other)
    yield from value_differences(case, other)
    yield from prior_differences(case, other, names)
