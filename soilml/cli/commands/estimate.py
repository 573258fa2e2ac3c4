"""`soilml estimate`: a trained model applied to measured rows, as on board."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.options import OPTIONAL, REPEATED, InputFile, OutputFile
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator

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
    from soilml.cli.progress import progress_bar
    from soilml.cli.tables import print_table_hints, read_case_of_rows, read_rows
    from soilml.config.compatibility import recipe_case
    from soilml.config.remainder import SAME_ROWS
    from soilml.identification.model_error_inputs import (
        readings_with_model_error,
        trained_remainder,
        with_exact_model,
    )
    from soilml.identification.trained_estimator import (
        check_table_wheel,
        estimators_for_case,
        narrower_priors,
    )
    from soilml.io.bounds import ESTIMATES
    from soilml.io.read_table import FILLED, RUNS
    from soilml.onboard import presentation
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.table_estimates import estimates_of_table
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
    hinted = case
    if case is None and not estimators[0].per_row:
        hinted = recipe_case(estimators[0].metadata["recipe"], estimators[0].path)
    print_table_hints(table, hinted, presentation.trained_radius(estimators[0]))
    pooled, first = args.by is not None, estimators[0]
    found = estimates_of_table(
        estimators, table, args.by, progress=progress_bar,
        adjusted=lambda one, readings: readings_with_model_error(
            one, readings, case, together=pooled
        ),
    )  # fmt: skip
    if case is not None and pooled and (box := narrower_priors(first, case)):
        found = replace(found, estimate=found.estimate.within(**box))
    columns = found.columns(list(dict.fromkeys(n for one in estimators for n in one.inputs)))
    remarks += presentation.remarks_on(found, estimators)
    if args.report is not None:
        presentation.check_size(len(columns["in_range"]))

    title = f"Estimates of {Path(args.runs).name} by {Path(args.trained).name}"
    report = presentation.estimate_report(found, columns, remarks, title)
    content = {
        "columns": {k: np.asarray(v).tolist() for k, v in columns.items()},
        "notes": [remark.as_json() for remark in remarks],
    }
    deliver(args, report, content, columns, [str(e.path) for e in estimators])
    return 0


def _check_options(args: argparse.Namespace, estimators: list[Estimator]) -> None:
    """Raise `InputError` for options that cannot be combined."""
    if args.runs is None and any((args.by, args.where, args.out, args.report)):
        raise InputError("RUNS.csv is missing: --by, --where, --out and --report are for its rows")
    if args.by is not None and args.with_:
        raise InputError("--with fuses single rows; omit --by")
    if args.by is not None and estimators[0].per_row:
        raise InputError(
            f"{args.trained} estimates {estimators[0].per_row[0]}, which differs from row to row "
            "of a run; omit --by"
        )
