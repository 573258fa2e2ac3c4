"""Estimates of the rows and runs of a table, by one file or several."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import TableError
from soilml.io.read_table import Rows, as_table
from soilml.io.table import ALL, Table
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import ROWS_PER_CALL, Estimator
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.onboard.set_contract import (
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    OPTIONAL_READINGS,
)
from soilml.quantities import CHANNELS, column
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


#: Opens a progress display of a text and a number of steps, which gives the function to report by.
Progress = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


@contextmanager
def unseen(text: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress display that shows nothing."""
    yield lambda done: None


@dataclass(frozen=True)
class TableEstimates:
    """Estimates of the n rows of a table, or of n groups of its rows, which have one soil each.

    estimator: The first file.
    table, by: The table, and the column of its groups; None where each row is by itself.
    names: Names of the groups.
    estimate: (n,).
    answered: Whether each had a row with all readings, (n,).
    rows: Rows with all readings of each group, (n,).
    files: Files that took part in each estimate, (n,), where several are fused.
    """

    estimator: Estimator
    table: Table
    by: str | None
    names: list[Any]
    estimate: Estimate
    answered: NDArray[np.bool_]
    rows: NDArray[np.int64]
    files: NDArray[np.int64] | None = None

    def columns(self, inputs: Sequence[str]) -> dict[str, Any]:
        """Columns (n,) of a table, with the readings of these names where each row is by itself."""
        if self.by is None:
            heads = ("run", *(column(name) for name in inputs))
            found: dict[str, Any] = {key: self.table[key] for key in heads}
        else:
            inside = self.rows - self.estimate.rows_set_aside
            found = {self.by: np.asarray(self.names), "rows": self.rows}
            found["rows_in_range"] = np.where(self.answered, inside, 0)
        found |= {
            key: np.where(self.answered, values, np.nan)
            for key, values in self.estimate.reading_columns().items()
        }
        found["in_range"] = self.answered & self.estimate.in_range
        if self.by is not None and self.estimator.sets is not None:
            found["disagrees"] = self.answered & self.estimate.disagrees.astype(bool)
        return found if self.files is None else found | {"files": self.files}


def estimates_of_table(
    estimators: Sequence[Estimator],
    table: Table,
    by: str | None = None,
    *,
    adjusted: Callable[[Estimator, dict[str, Any]], dict[str, Any]] = lambda _, readings: readings,
    progress: Progress = unseen,
) -> TableEstimates:
    """Estimates of all rows by themselves, fused where there are several files, or of groups.

    by: Column of whose groups each has one soil, or `all`; only the first file is then used.
    adjusted: Inputs of a file, changed for errors of its model.

    Raises `TableError` where no row has all readings of a file.
    """
    usable = [complete_rows(estimator, table) & table.answered for estimator in estimators]
    first = estimators[0]
    if not np.any(usable):
        wanted = ", ".join(column(name) for name in first.inputs)
        raise TableError(f"{table.source}: no row has all readings that the model needs: {wanted}")
    if by is None:
        found = []
        for estimator, rows in zip(estimators, usable, strict=True):
            alone = estimator.sets is not None and estimator.sets.sets_only
            own = joint_readings if alone else row_readings
            given = adjusted(estimator, own(estimator, table.rows(rows)))
            with progress(f"estimating {int(rows.sum())} rows", int(rows.sum())) as done:
                found.append(_estimates_of_rows(estimator, given, rows, done))
        answered = np.any(usable, axis=0)
        one = TableEstimates(first, table, None, [], found[0], answered, answered * 1)
        if len(found) == 1:
            return one
        fused = fuse_estimates(found)
        return replace(one, estimate=fused.estimate, files=fused.used.sum(axis=0))
    groups = dict(table.rows(usable[0]).groups(by))
    readings = [adjusted(first, joint_readings(first, rows)) for rows in groups.values()]
    with progress(f"estimating by {by}", len(groups)) as done:

        def one_by_one() -> Iterator[Estimate]:
            for number, one in enumerate(readings, 1):
                yield first.run(**one)
                done(number)

        estimate = Estimate.stack(one_by_one(), (len(readings),))
    names = [name for name, _ in table.groups(by)]
    place = {name: i for i, name in enumerate(groups)}
    answered = np.asarray([name in place for name in names])
    counts = np.asarray([len(groups[name]) if name in groups else 0 for name in names])
    estimate = estimate.at(np.asarray([place.get(name, 0) for name in names]))
    return TableEstimates(first, table, by, names, estimate, answered, counts)


def _estimates_of_rows(
    estimator: Estimator,
    readings: Mapping[str, Any],
    usable: NDArray[np.bool_],
    done: Callable[[int], None],
) -> Estimate:
    """An estimate for every row of a table; one that is not usable (rows,) is out of range."""
    result, index = estimator.prior_estimate(len(usable)), np.flatnonzero(usable)
    for first in range(0, index.size, ROWS_PER_CALL):
        block = slice(first, first + ROWS_PER_CALL)
        estimate = estimator(**{k: v[block] if np.ndim(v) else v for k, v in readings.items()})
        for key in Estimate.ARRAYS:
            getattr(result, key)[index[block]] = getattr(estimate, key)
        done(min(block.stop, index.size))
    return result


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
    estimator = model if isinstance(model, Estimator) else Estimator.load(model)
    found = estimates_of_table([estimator], as_table(rows), by)
    if by is None:
        return found.estimate.to_frame().set_axis(rows.index) if is_frame(rows) else found.estimate  # type: ignore[union-attr]
    of_groups = found.estimate.at(found.answered)
    if is_frame(rows):
        names = [name for name, known in zip(found.names, found.answered, strict=True) if known]
        return of_groups.to_frame().set_axis(names).rename_axis(by)
    return of_groups.at(0) if by == ALL else of_groups


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
