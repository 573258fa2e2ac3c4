"""The second answer of `estimate`: with the errors that a model usually has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.cli.estimate_text import estimate_columns, notes_on_runs
from soilml.cli.output import is_terminal, show, tell_columns
from soilml.cli.row_progress import row_progress
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import MODEL_ERROR_INPUT

if TYPE_CHECKING:
    from soilml.config.case import Case

#: Suffix of the columns of the second answer.
USUAL = "usual"


def usual_answer(
    estimator: Estimator,
    case: Case | None,
    by: str,
    names: Sequence[Any],
    readings: Sequence[dict[str, Any]],
    first: Estimate,
    box: Mapping[str, tuple[float, float]],
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Columns (runs,) of estimates with the usual errors of the model, and notes on both answers.

    None for a file that takes its model as right, or whose model already has errors, and where a
    case states the error of its model.

    Parameters
    ----------
    estimator, case
        The file, and the case that it is used for.
    by, names
        The column that numbers the runs, and its values.
    readings
        Inputs (rows,) of each run by name.
    first
        Estimates (runs,) with the model as it is.
    box
        Narrower priors of the case, by quantity.
    """
    declared = case is not None and bool(case.discrepancy)
    errors = {} if estimator.sets is None else estimator.sets.common_errors
    if declared or errors.get(MODEL_ERROR_INPUT) != 0.0:
        return {}, []
    usual, rows = estimator.on(model_error=1.0), sum(len(inputs["slip"]) for inputs in readings)
    with row_progress(f"estimating by {by} with usual errors", usual, rows) as counted:
        found = (counted.run(**inputs) for inputs in readings)
        second = Estimate.stack(
            (one.within(**box) if box else one for one in found), (len(readings),)
        )
    return _columns(second), _notes(by, names, first, second)


def _columns(estimate: Estimate) -> dict[str, NDArray[Any]]:
    """Columns of the second answer (runs,), by name: `cohesion_Pa_usual`, `_usual_std`, ..."""
    columns: dict[str, NDArray[Any]] = {}
    for key, values in estimate_columns(estimate).items():
        name, dash, part = key.rpartition("_")
        statistic = part in ("std", "p05", "p95")
        columns[f"{name}_{USUAL}{dash}{part}" if statistic else f"{key}_{USUAL}"] = values
    columns[f"in_range_{USUAL}"] = estimate.in_range.astype(float)
    return columns


def tell_answers(columns: Mapping[str, Any], out: str | None) -> None:
    """Write or print the columns of both answers; on a terminal, as two tables."""
    ends = (f"_{USUAL}", *(f"_{USUAL}_{part}" for part in ("std", "p05", "p95")))
    second = [name for name in columns if name.endswith(ends)]
    if not second or out is not None or not is_terminal():
        tell_columns(columns, out)
        return
    tell_columns({name: columns[name] for name in columns if name not in second}, None)
    show(f"\nas usual, with the errors that models usually have: columns with _{USUAL} in a file\n")
    group = next(iter(columns))
    usual = {name.replace(f"_{USUAL}", ""): columns[name] for name in second}
    usual["in_range"] = np.asarray(usual["in_range"], dtype=bool)
    tell_columns({group: columns[group]} | usual, None)


def _notes(by: str, names: Sequence[Any], first: Estimate, second: Estimate) -> list[str]:
    """What the two answers are, how they differ, and which one to believe."""
    notes = [
        f"two answers: columns without _{USUAL} are as if the model of wheel and soil were right; "
        f"columns with _{USUAL} are with the errors that it usually has, in the bearing of the "
        "soil, its contact behind the axle, sinkage and drawbar pull"
    ]
    both = first.in_range & second.in_range
    if both.any():
        ratio = np.median(second.std[both] / first.std[both], axis=0)
        widths = ", ".join(
            f"{name.replace('_', ' ')} {value:.1f}"
            for name, value in zip(first.names, ratio, strict=True)
        )
        notes.append(
            f"believe the columns with _{USUAL}, unless this model was checked on a soil that is "
            f"known; their intervals are wider by factors of {widths}"
        )
    told = []
    for i, name in enumerate(names):
        if int(first.reason[i]) == Reason.INCONSISTENT:
            believe = "nor does it with its usual errors; believe neither answer"
            if second.in_range[i]:
                believe = f"with its usual errors it does; believe the columns with _{USUAL}"
            told.append((name, f"the model as it is does not explain the rows, {believe}"))
    return notes + notes_on_runs(by, told)
