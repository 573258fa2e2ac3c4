"""`soilml estimate`: a trained model applied to measured rows, as on board."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.cli.advice_text import advice_after_estimate, median_row, widest_row
from soilml.cli.estimate_text import estimate_columns, refusal_notes, width_notes
from soilml.cli.joint_readings import (
    channel_note,
    joint_readings,
    row_readings,
    unused_std_note,
)
from soilml.cli.output import save_columns, show, tell
from soilml.cli.progress import progress_bar
from soilml.cli.reports.estimate import check_size, estimate_report
from soilml.cli.reports.report_files import write_with_report
from soilml.cli.row_progress import row_progress
from soilml.cli.table_reading import read_rows
from soilml.cli.table_remarks import print_table_hints
from soilml.cli.usual_errors.usual_model_error import tell_answers, usual_answer
from soilml.cli.wheel_check import (
    apply_case_option,
    check_table_wheel,
    describe_file,
    trained_radius,
)
from soilml.errors import InputError, TableError
from soilml.identification.trained_estimator import narrower_priors
from soilml.io.read_table import FILLED, RUNS
from soilml.io.table import ALL, Table
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import ROWS_PER_CALL, Estimator
from soilml.onboard.fusion_rules import COVARIANCE_INTERSECTION
from soilml.onboard.joint_errors import are_comparable
from soilml.onboard.multi_sensor import CORRELATED, fuse_estimates
from soilml.optional_imports import need
from soilml.quantities import column
from soilml.report.page import Report

if TYPE_CHECKING:
    from soilml.config.case import Case


def run(args: argparse.Namespace) -> int:
    """Estimate and write the table."""
    need("onnxruntime", "estimate")
    if args.report is not None:
        for library in ("jinja2", "matplotlib"):
            need(library, "estimate --report")
    estimators = [Estimator.load(file) for file in (args.model, *args.others)]
    _check_options(args, estimators)
    if args.runs is None and args.case is None:
        show("\n".join(describe_file(estimator) for estimator in estimators))
        return 0
    estimators, case, case_notes = apply_case_option(args, estimators)
    case_notes = [describe_file(estimator) for estimator in estimators] + case_notes
    if args.runs is None:
        show("\n".join(case_notes))
        return 0
    read = {name: column(name) for estimator in estimators for name in estimator.inputs}
    needed = tuple(key for key in RUNS if key in ("run", *read.values()))
    filled = [key for key in FILLED if key in needed]
    table = read_rows(args, (*needed, *sorted({*read.values()} - {*needed})), filled)
    for estimator in estimators:
        check_table_wheel(estimator, table)
    print_table_hints(table, case, trained_radius(estimators[0]))
    usable = [_complete(estimator, table) & table.answered for estimator in estimators]
    complete = np.any([_complete(estimator, table) for estimator in estimators], axis=0)
    if not np.any(usable):
        wanted = ", ".join(column(n) for n in estimators[0].inputs)
        raise TableError(f"{table.source}: no row has all readings that the model needs: {wanted}")
    if args.by is None:
        columns, notes = _row_estimates(estimators, table, usable, args.rule, case)
    else:
        columns, notes = _group_estimates(estimators[0], table, usable[0], args.by, case)
    notes = case_notes + notes
    if args.by is None or estimators[0].sets is None:
        notes += unused_std_note(estimators[0], table)
    notes += _excluded(table, ~complete, "lack a reading")
    notes += _excluded(table, complete & ~table.answered, "have a status that is not ok")
    count = len(columns["in_range"])
    if args.report is not None:
        check_size(count)

    def build() -> tuple[Report, dict[str, Any]]:
        content = {"columns": {k: np.asarray(v).tolist() for k, v in columns.items()}}
        files = args.model, args.runs
        page = estimate_report(columns, notes, estimators[0], args.by, files)
        return page, {**content, "notes": notes}

    write_with_report(
        args, {args.out: partial(save_columns, columns)}, build, [str(e.path) for e in estimators]
    )
    tell_answers(columns, args.out)
    tell("\n".join(notes))
    return 0


def _excluded(table: Table, rows: NDArray[np.bool_], why: str) -> list[str]:
    """A note on rows that get no estimate: how many, the reason, and the first three."""
    if not rows.any():
        return []
    some = ", ".join(str(table.place(int(i))) for i in np.flatnonzero(rows)[:3])
    more = ", ..." if rows.sum() > 3 else ""
    return [f"{int(rows.sum())} rows {why} and get no estimate: {some}{more}"]


def _check_options(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` for options that cannot be combined."""
    if args.runs is None and any((args.by, args.where, args.out, args.report)):
        raise InputError("RUNS.csv is missing: --by, --where, --out and --report are for its rows")
    if args.rule is not None and not args.others:
        raise InputError("--rule is the fusion rule of --with; give --with OTHER.onnx")
    if args.by is not None and args.others:
        raise InputError("--with fuses single rows; omit --by")
    known = are_comparable([e.pooling.held_out for e in estimators])
    if args.rule != COVARIANCE_INTERSECTION and not (known and args.rule in (None, CORRELATED)):
        _check_independent(args, estimators)
    if args.by is not None and estimators[0].per_row:
        raise InputError(
            f"{args.model} estimates {estimators[0].per_row[0]}, which differs from row to row of "
            "a run; omit --by"
        )


def _check_independent(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` where all inputs of one file are inputs of another: dependent errors."""
    files = list(zip((args.model, *args.others), estimators, strict=True))
    for (one, first), (other, second) in combinations(files, 2):
        shared = set(first.inputs) & set(second.inputs)
        if len(shared) == min(len(first.inputs), len(second.inputs)):
            names = ", ".join(column(name) for name in first.inputs if name in shared)
            raise InputError(
                f"{one} and {other} both read {names}: their errors are not independent; use one "
                f"of them, or --rule {COVARIANCE_INTERSECTION}"
            )


def _complete(estimator: Estimator, table: Table) -> NDArray[np.bool_]:
    """Rows that have all readings that the model needs, (rows,)."""
    return np.asarray(np.all([np.isfinite(table[column(n)]) for n in estimator.inputs], axis=0))


def _row_estimates(
    estimators: list[Estimator],
    table: Table,
    usable: list[NDArray[np.bool_]],
    rule: str | None,
    case: Case | None,
) -> tuple[dict[str, Any], list[str]]:
    """Columns with a line for every row, blank where no model has all its readings, and notes."""
    estimates = [_all_rows(*parts, table, case) for parts in zip(estimators, usable, strict=True)]
    answered = np.any(usable, axis=0)
    inputs = dict.fromkeys(name for estimator in estimators for name in estimator.inputs)
    columns: dict[str, Any] = {"run": table["run"]}
    columns |= {column(name): table[column(name)] for name in inputs}
    estimate, files = estimates[0], None
    if len(estimators) > 1:
        combined = fuse_estimates(estimates, rule)
        estimate, files = combined.estimate, combined.used.sum(axis=0)
    for key, values in estimate_columns(estimate).items():
        columns[key] = np.where(answered, values, np.nan)
    columns["in_range"] = answered & estimate.in_range
    hint = "pool rows with --by run"
    if files is not None:
        columns["files"] = files
    if estimators[0].per_row:
        hint = "measure with other sensors too, or train for a narrower prior of the soil,"
    notes = width_notes(estimate, "a single row", "does", hint)
    if len(estimators) > 1:
        notes.append(f"fused by the rule {combined.rule}")
    elif estimate.in_range.any():
        row = median_row(estimate)
        readings = row_readings(estimators[0], table.rows(np.asarray([row])))
        lines = advice_after_estimate(
            estimators[0], estimate.mean[row], estimate.covariance[row], readings
        )
        notes += [f"after {table.place(row)} alone, a typical row: {line}" for line in lines[-1:]]
    outside = int(np.count_nonzero(answered & ~estimate.in_range))
    if outside:
        why = "" if files is None else ", or the files contradict each other there"
        count = f"{outside} of {int(answered.sum())} rows"
        notes.append(f"{count} are out of range{why}: their estimate is the prior")
    return columns, notes


def _all_rows(
    estimator: Estimator, usable: NDArray[np.bool_], table: Table, case: Case | None
) -> Estimate:
    """An estimate for every row; one that is not usable counts as out of range."""
    result = estimator.prior_estimate(len(table))
    if usable.any():
        alone = estimator.sets is not None and estimator.sets.sets_only
        rows = table.rows(usable)
        readings = row_readings(estimator, rows)
        if alone:
            readings = joint_readings(estimator, rows, case, together=False)
        index = np.flatnonzero(usable)
        with progress_bar(f"estimating {index.size} rows", index.size) as done:
            for first in range(0, index.size, ROWS_PER_CALL):
                block = slice(first, first + ROWS_PER_CALL)
                estimate = estimator(
                    **{k: v[block] if np.ndim(v) else v for k, v in readings.items()}
                )
                for key in Estimate.ARRAYS:
                    getattr(result, key)[index[block]] = getattr(estimate, key)
                done(min(block.stop, index.size))
    return result


def _estimates_of_runs(
    estimator: Estimator, readings: list[dict[str, Any]], by: str, box: dict[str, Any]
) -> tuple[NDArray[np.int64], Estimate]:
    """Rows in range (groups,), and the estimates of groups of readings, within a narrower prior."""
    in_range = np.zeros(len(readings), dtype=np.int64)
    twice = 2 * sum(len(next(iter(one.values()))) for one in readings)
    with row_progress(f"estimating by {by}", estimator, twice) as counted:

        def estimates() -> Iterator[Estimate]:
            for i, one in enumerate(readings):
                in_range[i] = counted.rows_in_range(**one).sum()
                found = counted.run(**one)
                yield found.within(**box) if box else found

        return in_range, Estimate.stack(estimates(), (len(readings),))


def _group_estimates(
    estimator: Estimator, table: Table, usable: NDArray[np.bool_], by: str, case: Case | None
) -> tuple[dict[str, Any], list[str]]:
    """Columns with a line for every value of a column, from all its usable rows, and notes."""
    order = [name for name, _ in table.groups(by)]
    groups = list(table.rows(usable).groups(by))
    readings = [joint_readings(estimator, rows, case) for _, rows in groups]
    box = {} if case is None else narrower_priors(estimator, case)
    in_range, estimate = _estimates_of_runs(estimator, readings, by, box)
    position = {name: i for i, (name, _) in enumerate(groups)}
    answered = np.asarray([name in position for name in order])
    index = np.asarray([position.get(name, 0) for name in order])
    counts = np.asarray([len(rows) for _, rows in groups])
    columns: dict[str, Any] = {
        by: np.asarray(order),
        "rows": np.where(answered, counts[index], 0),
        "rows_in_range": np.where(answered, in_range[index], 0),
    }
    for key, values in estimate_columns(estimate).items():
        columns[key] = np.where(answered, values[index], np.nan)
    columns["in_range"] = answered & estimate.in_range[index]
    names = [name for name, _ in groups]
    second, second_notes = usual_answer(estimator, case, by, names, readings, estimate, box)
    columns |= {key: np.where(answered, values[index], np.nan) for key, values in second.items()}
    notes = channel_note(estimator, joint_readings(estimator, table.rows(usable)))
    whose = "all rows" if by == ALL else f"all rows of a {by}"
    better = "measure other loads and slips"
    if by != ALL and len(groups) > 1:
        better += f", or take those of one soil together, such as --by {ALL},"
    notes += width_notes(estimate, whose, "do", better)
    if estimate.in_range.any():
        name, rows = groups[i := widest_row(estimate)]
        lines = advice_after_estimate(
            estimator, estimate.mean[i], estimate.covariance[i], row_readings(estimator, rows)
        )
        notes += lines if by == ALL else [f"{by} {name}: {line}" for line in lines]
    notes += refusal_notes(by, names, counts - in_range, counts, estimate)
    return columns, notes + second_notes
