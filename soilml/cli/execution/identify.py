"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from dataclasses import replace

from soilml.cli.advice_text import advice_after_fit
from soilml.cli.option_values import available_effects, parse_names
from soilml.cli.output import is_terminal, json_text, show, tell, write_stdout
from soilml.cli.progress import progress_bar, working
from soilml.cli.reports.identify import Identification, identify_report
from soilml.cli.reports.report_files import write_with_report
from soilml.cli.table_reading import read_rows
from soilml.cli.table_remarks import print_table_hints
from soilml.cli.usual_errors.usual_fit import usual_fit
from soilml.config.case import read_case
from soilml.errors import FitError
from soilml.io.read_table import RUNS
from soilml.io.table import Table
from soilml.optional_imports import need


def run(args: argparse.Namespace) -> int:
    """Identify and write the result."""
    need("scipy", "identify")
    if args.report is not None:
        need("jinja2", "identify --report")
        need("matplotlib", "identify --report")
    from soilml.identification import identify

    case = read_case(args.model, available_effects(args), with_bias=True)
    table = read_rows(args, RUNS)
    print_table_hints(table, case)
    free = parse_names(args.free)
    failed: dict[str, str] = {}

    def solve(rows: Table) -> Identification:
        fit = identify(case, rows, free, args.method)
        advice = advice_after_fit(case, rows, free, fit) if fit.method == "posterior" else None
        fit = replace(fit, samples=None)  # those of thousands of runs are not held together
        return Identification(fit, usual_fit(case, rows, free, args.method, fit), advice)

    if args.by is None:
        with working(f"identifying from {len(table)} rows"):
            found = {"": solve(table)}
        content = found[""].as_json()
    else:
        groups = list(table.groups(args.by))
        with progress_bar(f"identifying by {args.by}", len(groups)) as done:
            found, failed = _solve_groups(groups, solve, done)
        if not found:
            name, why = next(iter(failed.items()))
            raise FitError(f"no {args.by} can be identified; {args.by} {name}: {why}")
        runs = {name: result.as_json() for name, result in found.items()}
        content = {"by": args.by, "runs": runs, "failed": failed}
    text = json_text(content)
    write_with_report(
        args,
        {args.out: text},
        lambda: (
            identify_report(case, found, failed, args.by, (args.model, args.runs)),
            content,
        ),
    )
    if args.out is not None or args.report is not None or is_terminal():
        heads = {name: f"{args.by} {name}: " if name else "" for name in found}
        show("\n\n".join(heads[name] + result.text() for name, result in found.items()))
    else:
        write_stdout(text)
    for name, why in failed.items():
        tell(f"{args.by} {name} has no result: {why}")
    return 0


def _solve_groups(
    groups: Iterable[tuple[str, Table]],
    solve: Callable[[Table], Identification],
    done: Callable[[int], None],
) -> tuple[dict[str, Identification], dict[str, str]]:
    """The result of each group, and the reason for each group without one."""
    found, failed = {}, {}
    for number, (name, rows) in enumerate(groups, 1):
        try:
            found[name] = solve(rows)
        except FitError as error:
            failed[name] = str(error)
        done(number)
    return found, failed
