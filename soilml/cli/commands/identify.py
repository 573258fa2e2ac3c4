"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.options import (
    InputFile,
    add_by_option,
    add_effects_option,
    add_model_and_runs,
    add_output,
    add_report_option,
    add_row_options,
)
from soilml.errors import InputError

if TYPE_CHECKING:
    from soilml.config.case import Case
    from soilml.identification.presentation import Identification
    from soilml.io.table import Table
    from soilml.report.page import Report
    from soilml.systems.tracked_robot.group_identification import ChannelRegression

FORMATS = ("table", "json")
DESCRIPTION = """\
Identify the soil parameters with which MODEL.toml explains the rows of
RUNS.csv.

  soilml identify MODEL.toml RUNS.csv --out result.json
  soilml identify MODEL.toml RUNS.csv --free cohesion,friction_angle
  soilml identify MODEL.toml RUNS.csv --method linear --where run=sand_3

RUNS.csv has the columns run, slip, load_N, torque_Nm (blank where not
measured) and optionally drawbar_pull_N, sinkage_m and <column>_std. Rows whose
status is not ok are ignored. A channel is used where its noise is declared, in
[noise] or by <column>_std. All rows are assumed to come from one soil, unless
--by run asks for a result for each run. Parameters with a prior are
identified, unless --free names others. Rows of several wheels name theirs,
one of [gears.NAME] in MODEL.toml, in the column gear.

Methods:
  averaged   (default) the soil averaged over explanations of the rows, each
             weighted by its evidence: the model as it is, a smooth error of
             it, effects of the catalogue; typical errors of sensors beside all
The others take the model as exact, and sensors but for [noise] and [bias]:
  posterior  mean, standard deviation and 90 % interval of the exact posterior
             under the priors and the noise
  nonlinear  bounded least squares on the full model, from several starts
  linear     cohesion and friction angle from sinkage; shear modulus known
  newton     friction angle, shear modulus and kphi from a closed form;
             cohesion known

Use `posterior` only where model and sensors were verified on a known soil. It
and `averaged` report which parameters the rows do not determine, and the next
measurement that would help most.

--mean averages the groups of --by, with the errors that they share. --fresh
predicts other rows by the mean, and gives the regression of measured on
predicted values:

  soilml identify MODEL.toml RUNS.csv --by run --mean --fresh MORE.csv

The result is JSON in SI units, in the file of --out or in a pipe; a terminal
shows a table. --report writes a page to read and print. `posterior/prior`
(remaining_fraction in the file) is the width of the estimate divided by that of the
prior. std is the expected error. Read the warnings.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_model_and_runs(parser)
    parser.add_argument(
        "--method",
        default="averaged",
        help="averaged (default), posterior, nonlinear, linear or newton",
    )
    parser.add_argument(
        "--free", metavar="A,B,...", help="parameters to identify (default: those with a prior)"
    )
    add_effects_option(parser)
    add_by_option(parser)
    parser.add_argument("--mean", action="store_true", help="with --by: the mean of the groups too")
    parser.add_argument(
        "--fresh",
        type=InputFile,
        metavar="MORE.csv",
        help="with --mean: other rows, measured against what the mean predicts",
    )
    add_row_options(parser)
    add_output(parser, "--out", "FILE.json", "write the result to this file")
    add_report_option(parser)


def run(args: argparse.Namespace) -> int:
    """Identify and write the result."""
    from dataclasses import replace

    from soilml.cli.options import available_effects, parse_names
    from soilml.cli.output import show_result, write_with_report
    from soilml.cli.tables import (
        print_table_hints,
        read_case_of_rows,
        read_rows,
        result_by_group,
        tell_failures,
    )
    from soilml.config.case import read_case
    from soilml.io.read_table import RUNS
    from soilml.optional_imports import need
    from soilml.report.page import json_text

    if args.mean and args.by is None:
        raise InputError("--mean averages groups: name their column, such as --by run")
    if args.fresh is not None and not args.mean:
        raise InputError("--fresh predicts rows by the mean of groups: add --mean")
    need("scipy", "identify")
    from soilml.experiment_design.advice_after_results import advice_after_fit
    from soilml.experiment_design.presentation import advice_as_json, next_row_remarks
    from soilml.identification import identify
    from soilml.identification.presentation import (
        Identification,
        identify_report,
        soil_entries,
    )
    from soilml.systems.tracked_robot.regression_presentation import (
        regression_picture,
        regression_text,
        regressions_as_json,
    )

    table = read_rows(args, RUNS)
    effects = available_effects(args)
    if args.gear is not None:
        case = read_case_of_rows(args, args.model, table, effects)
    else:
        case = read_case(args.model, effects, with_bias=True)
    print_table_hints(table, case)
    free = parse_names(args.free)

    def solve(rows: Table) -> Identification:
        fit = identify(case, rows, free, args.method)
        advice = None if fit.samples is None else advice_after_fit(case, rows, free, fit)
        soil = soil_entries(case, fit, free, with_draws=args.by is None)
        fit = replace(fit, samples=None)  # those of thousands of runs are not held together
        if advice is None:
            return Identification(fit, soil=soil)
        return Identification(fit, tuple(next_row_remarks(advice)), advice_as_json(advice), soil)

    found, failed = result_by_group(args, table, "identifying", solve)
    runs = {name: result.as_json() for name, result in found.items()}
    content = runs[""] if args.by is None else {"by": args.by, "runs": runs, "failed": failed}
    shown, lines = dict(found), None
    if args.mean:
        mean, lines = _mean(args, case, found, free)
        shown[f"mean of {len(found)}"] = mean
        content["mean"] = mean.as_json()
        if lines is not None:
            content["mean"]["regression"] = regressions_as_json(lines)
    text, files = json_text(content), (args.model, args.runs)

    def page() -> Report:
        report = identify_report(case, shown, failed, args.by, files)
        if lines is None:
            return report
        extra = regression_picture(lines, Path(args.fresh).name)
        return replace(report, pictures=[*report.pictures, extra])

    write_with_report(args, {args.out: text}, lambda: (page(), content))
    heads = {name: f"{args.by} {name}: " if name else "" for name in shown}
    parts = [heads[name] + result.text() for name, result in shown.items()]
    if lines is not None:
        parts.append(regression_text(lines, Path(args.fresh).name))
    show_result("\n\n".join(parts), {k: content[k] for k in content if k != "draws"})
    tell_failures(args.by, failed)
    return 0


def _mean(
    args: argparse.Namespace,
    case: Case,
    found: Mapping[str, Identification],
    free: Sequence[str] | None,
) -> tuple[Identification, dict[str, ChannelRegression] | None]:
    """The mean of the groups, and the regressions of the rows of --fresh on what it predicts."""
    from soilml.identification.presentation import Identification, soil_entries
    from soilml.io.read_table import read_table
    from soilml.systems.tracked_robot.group_identification import GroupFits, regressions

    fit = GroupFits(tuple(one.fit for one in found.values())).average
    mean = Identification(fit, soil=soil_entries(case, fit, free, with_draws=False))
    if args.fresh is None:
        return mean, None
    if case.gears:
        raise InputError("--fresh predicts rows of one gear: name it by --gear")
    rows = read_table(args.fresh, ("slip", "load_N"), ignore_extra=args.ignore_extra)
    return mean, regressions(case, fit, rows.rows(rows.answered))
