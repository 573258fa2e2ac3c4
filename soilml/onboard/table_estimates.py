"""Estimates of the rows and runs of a table: readings by name, blocks of rows, remarks."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError, TableError
from soilml.io.read_table import Rows, as_table
from soilml.io.table import ALL, Table
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import ROWS_PER_CALL, Estimator
from soilml.onboard.set_contract import (
    INFERRED,
    MODEL_ERROR_INPUT,
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    OPTIONAL_READINGS,
)
from soilml.onboard.set_posterior import SetPosterior
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.results import is_frame


def complete_rows(estimator: Estimator, table: Table) -> NDArray[np.bool_]:
    """Rows that have all readings that the model needs, (rows,)."""
    return np.asarray(np.all([np.isfinite(table[column(n)]) for n in estimator.inputs], axis=0))


def row_readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    """Inputs for the estimates of single rows, (rows,) by name."""
    return {name: table[column(name)] for name in estimator.inputs}


def joint_readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    """Inputs for the pooled estimate of all rows of one soil, (rows,) by name.

    In addition to the required readings: sinkage and drawbar pull where the table has them and
    their noise is known, and columns of standard deviations, those of slip and load included, which
    replace the noise of the file.
    """
    readings = row_readings(estimator, table)
    if estimator.sets is None:
        return readings
    for name in CHANNELS:
        key, spread = column(name), f"{column(name)}_std"
        known = name in estimator.sets.noise or spread in table
        if name in OPTIONAL_READINGS and key in table and known:
            readings[name] = table[key]
        if name in readings and spread in table:
            readings[f"{name}_std"] = _fill_blank_std(
                table[spread], estimator, name, readings[name]
            )
    for name, input_name in zip(OPERATING_NOISE, OPERATING_STD_INPUTS, strict=True):
        if (spread := f"{column(name)}_std") in table:
            readings[input_name] = _fill_blank_std(table[spread], estimator, name, readings[name])
    return readings


def _fill_blank_std(spread: Any, estimator: Estimator, name: str, reading: Any) -> Any:
    """Standard deviations of the table, and those of the model file where one is blank."""
    constant, share = estimator.sets.noise.get(name, (0.0, 0.0)) if estimator.sets else (0.0, 0.0)
    own = np.hypot(constant, share * np.abs(reading))
    return np.where(np.isfinite(spread) & (spread > 0.0), spread, own)


def estimates_of_rows(
    estimator: Estimator,
    readings: Mapping[str, Any],
    usable: NDArray[np.bool_],
    done: Callable[[int], None],
) -> Estimate:
    """An estimate for every row of a table; one that is not usable counts as out of range.

    readings: Inputs (usable rows,) by name.
    usable: Rows (rows,) that have all readings.
    done: Is given the number of rows that are estimated, after each block.
    """
    result, index = estimator.prior_estimate(len(usable)), np.flatnonzero(usable)
    for first in range(0, index.size, ROWS_PER_CALL):
        block = slice(first, first + ROWS_PER_CALL)
        estimate = estimator(**{k: v[block] if np.ndim(v) else v for k, v in readings.items()})
        for key in Estimate.ARRAYS:
            getattr(result, key)[index[block]] = getattr(estimate, key)
        done(min(block.stop, index.size))
    return result


def estimates_of_runs(
    estimator: Estimator,
    readings: Sequence[Mapping[str, Any]],
    box: Mapping[str, tuple[float, float]],
) -> Estimate:
    """Estimates (runs,) from the readings of each run, within a narrower prior if there is one."""
    found = (estimator.run(**one) for one in readings)
    shape = (len(readings),)
    return Estimate.stack((one.within(**box) if box else one for one in found), shape)


def estimate(rows: Rows, model: Estimator | str | os.PathLike[str], by: str | None = None) -> Any:
    """Estimates of measured rows by a trained model, as on board.

    Parameters
    ----------
    rows
        A table, a data frame, columns, or the path of a file, as for `identify`.
    model
        The trained model or the path of its file. One for wheels of any size is given its wheel by
        `Estimator.on`.
    by
        Column, such as run, of whose groups each has one soil; `all` for one soil of all rows; by
        default each row is estimated by itself.

    Returns
    -------
    Estimate or data frame
        Of a data frame of pandas, one with the index of the rows, or with the groups as index.
        Otherwise an `Estimate` (rows,) or (groups,), without dimension for `all`.

    Raises
    ------
    InputError, TableError, ModelFileError
        As `read_table`, `Estimator.load` and `Estimator.run`; also where no row is complete.
    """
    table = as_table(rows)
    estimator = model if isinstance(model, Estimator) else Estimator.load(model)
    usable = complete_rows(estimator, table) & table.answered
    if not usable.any():
        wanted = ", ".join(column(name) for name in estimator.inputs)
        raise TableError(f"{table.source}: no row has all readings that the model needs: {wanted}")
    if by is None:
        alone = estimator.sets is not None and estimator.sets.sets_only
        own = joint_readings if alone else row_readings
        given = own(estimator, table.rows(usable))
        found = estimates_of_rows(estimator, given, usable, lambda _: None)
        return found.to_frame().set_axis(rows.index) if is_frame(rows) else found  # type: ignore[union-attr]
    groups = list(table.rows(usable).groups(by))
    readings = [joint_readings(estimator, own) for _, own in groups]
    found = estimates_of_runs(estimator, readings, {})
    if is_frame(rows):
        return found.to_frame().set_axis([name for name, _ in groups]).rename_axis(by)
    return found.at(0) if by == ALL else found


def check_independent(estimators: Sequence[Estimator]) -> None:
    """Raise `InputError` where all inputs of one file are inputs of another: dependent errors."""
    for first, second in combinations(estimators, 2):
        shared = set(first.inputs) & set(second.inputs)
        if len(shared) == min(len(first.inputs), len(second.inputs)):
            names = ", ".join(column(name) for name in first.inputs if name in shared)
            raise InputError(
                f"{first.path} and {second.path} both read {names}: their errors are not "
                "independent; use one of them"
            )


def excluded_rows(table: Table, rows: NDArray[np.bool_], code: str, why: str) -> list[Remark]:
    """A remark on rows that get no estimate: how many, the reason, and the first three."""
    if not rows.any():
        return []
    some = ", ".join(str(table.place(int(i))) for i in np.flatnonzero(rows)[:3])
    more = ", ..." if rows.sum() > 3 else ""
    return [Remark(code, f"{int(rows.sum())} rows {why} and get no estimate: {some}{more}")]


def unused_std_remarks(estimator: Estimator, table: Table) -> list[Remark]:
    """A note on columns of standard deviations that estimates of single rows do not use."""
    if estimator.sets is not None and estimator.sets.sets_only:
        return []
    spreads = [f"{column(name)}_std" for name in (*CHANNELS, *OPERATING_NOISE)]
    given = tuple(key for key in spreads if key in table)
    if not given:
        return []
    hint = "give --by" if estimator.sets is not None else "train a file with [set_posterior]"
    text = f"estimates of single rows do not use {', '.join(given)}; {hint} to have them used"
    return [Remark("unused-std", text, given, "note")]


def channel_remarks(estimator: Estimator, readings: dict[str, Any]) -> list[Remark]:
    """A note on the channels used, for a file that can use more than it requires."""
    if estimator.sets is None:
        return []
    rows = {name: int(np.isfinite(readings[name]).sum()) for name in CHANNELS if name in readings}
    used = {name: count for name, count in rows.items() if count}
    said = ", ".join(f"{name.replace('_', ' ')} ({count} rows)" for name, count in used.items())
    first = Remark("channels-used", f"uses slip, load and {said}", tuple(used), "note")
    remarks = [first, *_common_error_remarks(estimator.sets)]
    size = estimator.sets.common_errors.get(MODEL_ERROR_INPUT, 0.0)
    if size == INFERRED:
        text = "errors of the model are included, of a size that follows from the residuals"
    elif size:
        text = f"errors of the model are included, {size:g} times the usual ones"
    else:
        text = "a perfect model is assumed, or one with the errors that the case states"
    return [*remarks, Remark("model-errors", text, severity="note")]


def _common_error_remarks(sets: SetPosterior) -> list[Remark]:
    """A note on the errors that all rows are assumed to share."""
    stds = {n: std for n, std in sets.common_errors.items() if std > 0.0 and n in ERRORS_SHOWN}
    if not stds:
        return []
    said = sensor_errors_shown(stds)
    text = f"assumes that all rows share errors with standard deviations of {said}"
    return [Remark("shared-errors", text, tuple(stds), "note")]


#: Errors of sensors that all rows share: factor from the SI unit, and text; gains in %.
ERRORS_SHOWN = {
    "slip_bias": (1.0, "slip {:.3g}"),
    "load_gain": (100.0, "load {:.3g} %"),
    "torque_gain": (100.0, "torque {:.3g} %"),
    "sinkage_bias": (1e3, "sinkage {:.3g} mm"),
    "drawbar_pull_bias": (1.0, "drawbar pull {:.3g} N"),
}


def sensor_errors_shown(stds: Mapping[str, float]) -> str:
    """Standard deviations of errors of sensors, by input of a file, in words."""
    shown = (
        (text, factor * stds[name]) for name, (factor, text) in ERRORS_SHOWN.items() if name in stds
    )
    return ", ".join(text.format(value) for text, value in shown)
