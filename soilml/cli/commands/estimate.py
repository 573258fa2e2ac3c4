"""`soilml estimate`: a trained model applied to measured rows, as on board."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.options import OPTIONAL, REPEATED, InputFile, OutputFile
from soilml.errors import InputError, TableError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from soilml.config.case import Case
    from soilml.io.table import Table
    from soilml.onboard.estimate import Estimate
    from soilml.onboard.estimator import Estimator
    from soilml.remarks import Remark

FORMATS = ("table", "csv", "json")
DESCRIPTION = """\
Estimate soil parameters, or slip, with the model file MODEL.onnx. The results
are those of the onboard runtime.

  soilml estimate exported/wheel.onnx
  soilml estimate exported/wheel.onnx RUNS.csv --by run --out estimates.csv
  soilml estimate exported/any_wheel.onnx RUNS.csv --model MODEL.toml --by run
  soilml estimate slip_torque.onnx RUNS.csv --with slip_vibration.onnx

Without a table, one line says what the file is for: wheel, effects and priors.
--model compares them with those of your model file, and refuses another wheel.

Each row gives mean, standard deviation (_std) and 90 % interval (_p05, _p95)
of every parameter, and in_range: 0 where the readings lie outside the training
data; the estimate is then the prior. A single row is close to the prior. --by
run pools all rows of a run, and --by all those of all runs, on one soil.

sinkage_m, drawbar_pull_N and <column>_std are used where the table has them,
slip_std and load_N_std included. The interval includes errors of the model,
whose size follows from the residuals; --exact-model leaves them out. disagrees
is 1 where the rows of a run fit no exact model: check units, sensors, wheel.
A row with a blank reading, or whose status is not ok, gets a blank estimate.

--with fuses, row by row, files that estimate the same parameters from other
sensors; the column `files` counts those that took part. Only numpy and
onnxruntime are needed, but for --report. CSV files are in SI units.
"""
ARGUMENTS = (
    ("trained MODEL.onnx", "trained model file", InputFile),
    ("runs RUNS.csv", "measured rows; without them, what the file is for", InputFile, OPTIONAL),
    ("--by COLUMN", "one estimate for each value of this column, such as run, or all"),
    ("--with OTHER.onnx", "a file to fuse with; can be repeated", InputFile, REPEATED),
    ("--model MODEL.toml", "your wheel, effects, soil, priors and noise", InputFile),
    "exact-model",
    "rows",
    ("--out FILE.csv", "write the estimates to this file", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Estimate and write the table."""
    from soilml.optional_imports import need

    need("onnxruntime", "estimate")
    import numpy as np

    from soilml.cli.output import deliver, show
    from soilml.cli.tables import print_table_hints, read_case_of_rows, read_rows
    from soilml.config.remainder import SAME_ROWS
    from soilml.experiment_design.expected_answers import trained_case
    from soilml.identification.model_error_inputs import trained_remainder, with_exact_model
    from soilml.identification.trained_estimator import check_table_wheel, estimators_for_case
    from soilml.io.bounds import ESTIMATES
    from soilml.io.read_table import FILLED, RUNS
    from soilml.onboard import presentation, table_estimates
    from soilml.onboard.estimator import Estimator
    from soilml.quantities import column
    from soilml.remarks import texts

    estimators = [Estimator.load(file) for file in (args.trained, *args.with_)]
    _check_options(args, estimators)
    if args.runs is None and args.model is None:
        show("\n".join(presentation.description(estimator).text for estimator in estimators))
        return 0
    read = {name: column(name) for estimator in estimators for name in estimator.inputs}
    needed = tuple(key for key in RUNS if key in ("run", *read.values()))
    filled = [key for key in FILLED if key in needed]
    table, case, own = None, None, []
    if args.runs is not None:
        table = read_rows(args, (*needed, *sorted({*read.values()} - {*needed})), filled)
        ESTIMATES.check(table.source, len(table))
    if args.model is not None:
        case = read_case_of_rows(args, args.model, table)
        if table is not None and not any(map(trained_remainder, estimators)):
            learned, case = case.remainder, case.without_remainder_of(table)
            own = [SAME_ROWS] if case.remainder is not learned else []
    if args.exact_model:
        estimators = [with_exact_model(estimator) for estimator in estimators]
    estimators, remarks = estimators_for_case(
        estimators, case, args.model, pooled=args.by is not None
    )
    remarks = [*map(presentation.description, estimators), *remarks, *own]
    if table is None:
        show("\n".join(texts(remarks)))
        return 0
    for estimator in estimators:
        check_table_wheel(estimator, table)
    trained = None if case is not None else trained_case(estimators[0])
    hinted = case if trained is None else trained[0]
    print_table_hints(table, hinted, presentation.trained_radius(estimators[0]))
    complete = [table_estimates.complete_rows(estimator, table) for estimator in estimators]
    usable = [rows & table.answered for rows in complete]
    if not np.any(usable):
        wanted = ", ".join(column(n) for n in estimators[0].inputs)
        raise TableError(f"{table.source}: no row has all readings that the model needs: {wanted}")
    if args.by is None:
        columns, own = _row_estimates(estimators, table, usable, case)
    else:
        columns, own = _group_estimates(estimators[0], table, usable[0], args.by, case)
    remarks += own
    if args.by is None or estimators[0].sets is None:
        remarks += table_estimates.unused_std_remarks(estimators[0], table)
    some = np.any(complete, axis=0)
    remarks += table_estimates.excluded_rows(table, ~some, "missing-reading", "lack a reading")
    unanswered = some & ~table.answered
    remarks += table_estimates.excluded_rows(
        table, unanswered, "status-not-ok", "have a status that is not ok"
    )
    if args.report is not None:
        presentation.check_size(len(columns["in_range"]))

    title = f"Estimates of {Path(args.runs).name} by {Path(args.trained).name}"
    report = presentation.estimate_report(columns, remarks, estimators[0], args.by, title)
    content = {
        "columns": {k: np.asarray(v).tolist() for k, v in columns.items()},
        "notes": [remark.as_json() for remark in remarks],
    }
    deliver(args, report, content, columns, [str(e.path) for e in estimators])
    return 0


def _check_options(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` for options that cannot be combined."""
    from soilml.onboard import table_estimates
    from soilml.onboard.joint_errors import are_comparable

    if args.runs is None and any((args.by, args.where, args.out, args.report)):
        raise InputError("RUNS.csv is missing: --by, --where, --out and --report are for its rows")
    if args.by is not None and args.with_:
        raise InputError("--with fuses single rows; omit --by")
    if not are_comparable([e.errors for e in estimators]):
        table_estimates.check_independent(estimators)
    if args.by is not None and estimators[0].per_row:
        raise InputError(
            f"{args.trained} estimates {estimators[0].per_row[0]}, which differs from row to row "
            "of a run; omit --by"
        )


def _row_estimates(
    estimators: list[Estimator],
    table: Table,
    usable: list[NDArray[np.bool_]],
    case: Case | None,
) -> tuple[dict[str, Any], list[Remark]]:
    """Columns with a line for every row, blank where no model has all its readings, and remarks."""
    import numpy as np

    from soilml.experiment_design.next_rows import advice_after_estimate
    from soilml.onboard import presentation, table_estimates
    from soilml.onboard.multi_sensor import fuse_estimates
    from soilml.quantities import column
    from soilml.remarks import Remark

    estimates = [_all_rows(*parts, table, case) for parts in zip(estimators, usable, strict=True)]
    answered = np.any(usable, axis=0)
    inputs = dict.fromkeys(name for estimator in estimators for name in estimator.inputs)
    columns: dict[str, Any] = {"run": table["run"]}
    columns |= {column(name): table[column(name)] for name in inputs}
    estimate, files = estimates[0], None
    if len(estimators) > 1:
        combined = fuse_estimates(estimates)
        estimate, files = combined.estimate, combined.used.sum(axis=0)
    for key, values in presentation.estimate_columns(estimate).items():
        columns[key] = np.where(answered, values, np.nan)
    columns["in_range"] = answered & estimate.in_range
    if files is not None:
        columns["files"] = files
    hint = "pool rows with --by run"
    if estimators[0].per_row:
        hint = "measure with other sensors too, or train for a narrower prior of the soil,"
    remarks = presentation.width_remarks(estimate, "a single row", "does", hint)
    if len(estimators) > 1:
        remarks.append(Remark("fused", f"fused by the rule {combined.rule}", severity="note"))
    elif estimate.in_range.any():
        row = presentation.median_row(estimate)
        readings = table_estimates.row_readings(estimators[0], table.rows(np.asarray([row])))
        advised = advice_after_estimate(
            estimators[0], estimate.mean[row], estimate.covariance[row], readings
        )
        head = f"after {table.place(row)} alone, a typical row: "
        remarks += [best.under(head) for best in advised[-1:]]
    outside = int(np.count_nonzero(answered & ~estimate.in_range))
    if outside:
        why = "" if files is None else ", or the files contradict each other there"
        text = f"{outside} of {int(answered.sum())} rows are out of range{why}: "
        remarks.append(Remark("out-of-range", f"{text}their estimate is the prior"))
    return columns, remarks


def _all_rows(
    estimator: Estimator, usable: NDArray[np.bool_], table: Table, case: Case | None
) -> Estimate:
    """An estimate for every row; one that is not usable counts as out of range."""
    from soilml.cli.progress import progress_bar
    from soilml.identification.model_error_inputs import readings_with_model_error
    from soilml.onboard import table_estimates

    rows = table.rows(usable)
    readings = table_estimates.row_readings(estimator, rows)
    if estimator.sets is not None and estimator.sets.sets_only:
        readings = table_estimates.joint_readings(estimator, rows)
    readings = readings_with_model_error(estimator, readings, case, together=False)
    with progress_bar(f"estimating {len(rows)} rows", len(rows)) as done:
        return table_estimates.estimates_of_rows(estimator, readings, usable, done)


def _group_estimates(
    estimator: Estimator, table: Table, usable: NDArray[np.bool_], by: str, case: Case | None
) -> tuple[dict[str, Any], list[Remark]]:
    """Columns with a line for every value of a column, from all its usable rows, and remarks."""
    import numpy as np

    from soilml.cli.progress import working
    from soilml.experiment_design.next_rows import advice_after_estimate
    from soilml.identification.model_error_inputs import readings_with_model_error
    from soilml.identification.trained_estimator import narrower_priors
    from soilml.io.table import ALL
    from soilml.onboard import presentation, table_estimates

    order = [name for name, _ in table.groups(by)]
    groups = list(table.rows(usable).groups(by))
    names = [name for name, _ in groups]
    readings = [
        readings_with_model_error(
            estimator, table_estimates.joint_readings(estimator, rows), case, together=True
        )
        for _, rows in groups
    ]
    box = {} if case is None else narrower_priors(estimator, case)
    counts = np.asarray([len(rows) for _, rows in groups])
    with working(f"estimating by {by}"):
        estimate = table_estimates.estimates_of_runs(estimator, readings, box)
    outside = estimate.rows_set_aside
    position = {name: i for i, name in enumerate(names)}
    answered = np.asarray([name in position for name in order])
    index = np.asarray([position.get(name, 0) for name in order])
    columns: dict[str, Any] = {
        by: np.asarray(order),
        "rows": np.where(answered, counts[index], 0),
        "rows_in_range": np.where(answered, (counts - outside)[index], 0),
    }
    for key, values in presentation.estimate_columns(estimate).items():
        columns[key] = np.where(answered, values[index], np.nan)
    columns["in_range"] = answered & estimate.in_range[index]
    if estimator.sets is not None:
        columns["disagrees"] = answered & estimate.disagrees[index].astype(bool)
    remarks = table_estimates.channel_remarks(
        estimator, table_estimates.joint_readings(estimator, table.rows(usable))
    )
    whose = "all rows" if by == ALL else f"all rows of a {by}"
    better = "measure other loads and slips"
    if by != ALL and len(groups) > 1:
        better += f", or take those of one soil together, such as --by {ALL},"
    remarks += presentation.width_remarks(estimate, whose, "do", better)
    if estimate.in_range.any():
        name = names[i := presentation.widest_row(estimate)]
        head = "" if by == ALL else f"{by} {name}: "
        remarks += [
            one.under(head)
            for one in advice_after_estimate(
                estimator,
                estimate.mean[i],
                estimate.covariance[i],
                readings[i],
                box,
            )
        ]
    remarks += presentation.refusal_remarks(by, names, outside, counts, estimate)
    return columns, remarks
