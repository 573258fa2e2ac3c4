"""`soilml pull`: drawbar pull against slip and the slope that can be climbed, with bands."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from soilml.cli.option_values import available_effects, parse_names, parse_numbers
from soilml.cli.progress import progress_bar, working
from soilml.cli.reports.presentation import write_results
from soilml.cli.table_reading import read_rows
from soilml.cli.table_remarks import print_table_hints
from soilml.config.case import Case, read_case, read_case_of_one_gear
from soilml.config.wheeled_rover import read_gravity
from soilml.errors import FitError, InputError
from soilml.io.read_table import RUNS
from soilml.io.table import Table
from soilml.optional_imports import need

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator

Report = TypeVar("Report")

#: Largest number of loads.
MAX_LOADS = 8


def run(args: argparse.Namespace) -> int:
    """Predict and write the results."""
    from soilml.cli.reports.pull import PRESENTATION
    from soilml.traction.report import pull_report

    _check(args)
    table = read_rows(args, RUNS)
    if args.load is None and args.gear is None:
        whole = read_case(args.model, available_effects(args), with_bias=True)
        if whole.rover is not None:
            print_table_hints(table, whole)
            return _run_rover(args, whole, table)
    for option in ("slope", "gravity"):
        if getattr(args, option) is not None:
            raise InputError(
                f"--{option} needs a model file with [rover], and neither --load nor --gear"
            )
    case = read_case_of_one_gear(args.model, available_effects(args), args.gear, True)
    print_table_hints(table, case)
    options: dict[str, Any] = {
        "loads": None if args.load is None else parse_numbers("--load", args.load).tolist(),
        "slip_limit": args.slip_limit,
        "free": parse_names(args.free),
        "estimator": _estimator(args),
        "as_usual": args.as_usual,
    }
    if len(options["loads"] or ()) > MAX_LOADS:
        raise InputError(f"--load names {len(options['loads'])} loads; at most {MAX_LOADS}")
    found, failed = _by_group(args, table, lambda rows: pull_report(case, rows, **options))
    write_results(args, found, PRESENTATION, failed)
    return 0


def _run_rover(args: argparse.Namespace, case: Case, table: Table) -> int:
    """The same for a whole rover."""
    from soilml.cli.reports.rover import rover_presentation
    from soilml.traction.rover.report import rover_report, with_gravity

    if args.gravity is not None:
        case = with_gravity(case, read_gravity(args.gravity))
    slopes = None if args.slope is None else np.deg2rad(parse_numbers("--slope", args.slope))
    options: dict[str, Any] = {"slopes": slopes, "slip_limit": args.slip_limit}
    options |= {"free": parse_names(args.free), "estimator": _estimator(args)}
    options["as_usual"] = args.as_usual
    found, failed = _by_group(args, table, lambda rows: rover_report(case, rows, **options))
    assert case.rover is not None
    write_results(args, found, rover_presentation(case.rover), failed)
    return 0


def _by_group(
    args: argparse.Namespace, table: Table, answer: Callable[[Table], Report]
) -> tuple[dict[str, Report], dict[str, str]]:
    """The answer for each group of --by that has one, and why the others have none."""
    found, failed = {}, {}
    if args.by is None:
        with working(f"predicting from {len(table)} rows"):
            return {"": answer(table)}, {}
    groups = list(table.groups(args.by))
    with progress_bar(f"predicting by {args.by}", len(groups)) as done:
        for number, (name, rows) in enumerate(groups, 1):
            try:
                found[name] = answer(rows)
            except FitError as error:
                failed[name] = str(error)
            done(number)
    if not found:
        name, why = next(iter(failed.items()))
        raise FitError(f"no {args.by} has a result; {args.by} {name}: {why}")
    return found, failed


def _estimator(args: argparse.Namespace) -> Estimator | None:
    """The trained file of --from."""
    if args.trained is None:
        return None
    need("onnxruntime", "pull")
    from soilml.onboard.estimator import Estimator

    return Estimator.load(args.trained)


def _check(args: argparse.Namespace) -> None:
    if args.slip_limit is not None and not 0.0 < args.slip_limit < 1.0:
        raise InputError(f"--slip-limit is {args.slip_limit:g}; needed is a slip between 0 and 1")
    if args.report is not None:
        need("jinja2", "pull --report")
        need("matplotlib", "pull --report")
    if args.picture is not None:
        need("matplotlib", "pull --picture")
        if args.by is not None:
            raise InputError(
                "--picture draws one soil; select it with --where run=NAME instead of --by"
            )
    if args.trained is not None and args.as_usual:
        raise InputError("--as-usual applies to the posterior, not to the file of --from")
    if args.trained is not None and args.free is not None:
        raise InputError(
            "--free applies to the posterior; the parameters of --from are those of the model file"
        )
