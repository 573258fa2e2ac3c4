"""Model files for the wheel and soil of a case, and whether a table is of the same wheel."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import (
    check_wheel_columns,
    effect_differences,
    effect_value_differences,
    gear_differences,
    prior_differences,
    recipe_case,
    soil_value_differences,
)
from soilml.errors import InputError, TableError
from soilml.fitting.soil_tests import ignored_soil_tests
from soilml.identification.trained_estimator import (
    condition_on_case,
    narrower_priors,
    std_with_discrepancy,
    with_sensors_of,
)
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.quantities import QUANTITIES
from soilml.remarks import Remark

_HINT = "select rows with --where, or train a model for this wheel"


def estimators_for_case(
    estimators: Sequence[Estimator], case: Case | None, name: str, *, pooled: bool
) -> tuple[list[Estimator], list[Remark]]:
    """The estimators for the wheel and soil of a case, and remarks on what is ignored of it.

    Parameters
    ----------
    case, name
        The case, if there is one, and the name of its file.
    pooled
        Whether all rows of a soil are estimated together.

    Raises
    ------
    InputError
        Where a file for wheels of any size has no case, and where the gear or the effects of the
        case are not those of a file.
    """
    given, remarks = [], []
    for estimator in estimators:
        if estimator.sets is not None and estimator.sets.missing_context:
            if case is None:
                raise InputError(
                    f"{estimator.path} is for wheels of any size: give --case MODEL.toml with your "
                    "[gear], [soil], [soil.prior] and [noise]"
                )
            estimator, own = condition_on_case(estimator, case)
            remarks += own
        elif case is not None:
            together = estimator.sets is not None and pooled
            remarks += _compare(estimator, case, name, together)
            estimator = with_sensors_of(estimator, case) if together else estimator
        given.append(estimator)
    if case is not None and case.discrepancy:
        remarks.append(_discrepancy_remark(given[0], case, pooled))
    if case is not None:
        remarks += ignored_soil_tests(case)
    return given, remarks


def readings_with_discrepancy(
    estimator: Estimator, readings: dict[str, Any], case: Case | None, *, together: bool
) -> dict[str, Any]:
    """Inputs (rows,) by name, whose standard deviations include the discrepancy of the case."""
    if case is None or not case.discrepancy or estimator.sets is None:
        return readings
    noise = estimator.sets.noise
    return readings | std_with_discrepancy(case.discrepancy, readings, noise, together=together)


def _compare(estimator: Estimator, case: Case, name: str, together: bool) -> list[Remark]:
    """Remarks on what differs between a file for one wheel and the case.

    Raises `InputError` where gear or effects do.
    """
    own = recipe_case(estimator.metadata["recipe"], estimator.path)
    if own is None:
        text = f"{estimator.path} does not state its wheel: it cannot be compared with {name}"
        return [Remark("wheel-not-stated", text)]
    wrong = [
        *gear_differences(case, own, name),
        *effect_differences(case, own, name),
        *effect_value_differences(case, own, name),
    ]
    if wrong:
        raise InputError(
            f"{estimator.path} is not for the wheel of {name}: {'; '.join(wrong)}; train a file "
            "for this model, or correct [gear] and [[effect]]"
        )
    used = narrower_priors(estimator, case) if together else {}
    different = chain(
        soil_value_differences(case, own, name),
        prior_differences(case, own, [n for n in estimator.names if n not in used], name),
        () if together else _noise_differences(case, own, name),
    )
    return [
        Remark("ignored-setting", f"{estimator.path}: {text}, which is ignored")
        for text in different
    ]


def _noise_differences(case: Case, own: Case, name: str) -> Iterator[str]:
    """Declared noise of the case that is not that of the file."""
    for key, noise in case.noise.items():
        if noise != own.noise.get(key):
            yield f"noise of {key} as in its recipe, {name} has another one"
    if case.bias:
        yield f"no bias of {', '.join(case.bias)}, {name} declares it"


def _discrepancy_remark(estimator: Estimator, case: Case, pooled: bool) -> Remark:
    names = ", ".join(case.discrepancy)
    if estimator.sets is None or not (pooled or estimator.sets.sets_only):
        text = f"estimate ignores the [discrepancy] of {names}: the file takes no noise of a row"
        return Remark("ignored-setting", text, tuple(case.discrepancy))
    text = (
        f"[discrepancy] of {names} is included as independent errors of the rows, enlarged by the "
        "rows near them: intervals are wider than those of soilml identify"
    )
    return Remark("discrepancy-included", text, tuple(case.discrepancy), "note")


def check_table_wheel(estimator: Estimator, table: Table) -> None:
    """Raise `TableError` where the table's wheel columns differ from the wheel of the training."""
    gear = json.loads(estimator.metadata["gear"])
    fixed = estimator.sets.context_values if estimator.sets is not None else {}
    sizes = {n: fixed.get(f"wheel_{n}", gear.get(n)) for n in ("radius", "width")}
    check_wheel_columns(table, sizes, "the model was trained for", _HINT)
    effects = json.loads(estimator.metadata["recipe"]).get("effect", [])
    key = QUANTITIES["grouser_height"].column
    if key in table and not any(effect["name"] == "grousers" for effect in effects):
        lugs = table[key] > 0.0
        if lugs.any():
            row = int(np.argmax(lugs))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was "
                f"trained for a wheel without lugs; {_HINT}"
            )
