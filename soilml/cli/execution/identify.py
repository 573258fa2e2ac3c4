"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from soilml.cli.advice_text import advice_after_fit
from soilml.cli.option_values import available_effects, parse_names, read_rows
from soilml.cli.output import is_terminal, json_text, write_stdout
from soilml.cli.progress import progress_bar, working
from soilml.cli.table_remarks import print_table_hints
from soilml.cli.usual_errors.usual_fit import UsualFit, usual_fit
from soilml.config.case import read_case
from soilml.errors import FitError
from soilml.experiment_design import Advice, is_identified
from soilml.experiment_design.messages import next_row_messages, summary
from soilml.identification.fit_result import Fit
from soilml.io.atomic_files import save_text
from soilml.io.read_table import RUNS
from soilml.io.table import Table
from soilml.io.text_tables import format_table
from soilml.optional_imports import need


def run(args: argparse.Namespace) -> int:
    """Identify and write the result."""
    need("scipy", "identify")
    from soilml.identification import identify

    case = read_case(args.model, available_effects(args), with_bias=True)
    table = read_rows(args, RUNS)
    print_table_hints(table, case)
    free = parse_names(args.free)
    failed: dict[str, str] = {}

    def solve(rows: Table) -> Identification:
        fit = identify(case, rows, free, args.method)
        advice = advice_after_fit(case, rows, free, fit) if fit.method == "posterior" else None
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
    if args.out is not None:
        save_text(args.out, text)
    if args.out is not None or is_terminal():
        heads = {name: f"{args.by} {name}: " if name else "" for name in found}
        print("\n\n".join(heads[name] + result.text() for name, result in found.items()))
    else:
        write_stdout(text)
    for name, why in failed.items():
        print(f"{args.by} {name} has no result: {why}", file=sys.stderr)
    return 0


@dataclass(frozen=True)
class Identification:
    """A fit, the one with usual errors, and the next measurement that the posterior advises."""

    fit: Fit
    usual: UsualFit | None = None
    advice: Advice | None = None

    def as_json(self) -> dict[str, Any]:
        """The content of the file, for one fit."""
        content = self.fit.as_json()
        if self.usual is not None:
            content |= {"as_usual": self.usual.as_json()}
        if self.advice is not None:
            identified = is_identified(self.advice.current_fraction).tolist()
            flags = dict(zip(self.advice.names, identified, strict=True))
            content |= {"told": flags, "advice": summary(self.advice)}
        return content

    def text(self) -> str:
        """The fit as a table, its warnings, the second answer, and the advised measurement."""
        usual = [] if self.usual is None else ["", self.usual.text()]
        messages = [] if self.advice is None else ["", *next_row_messages(self.advice)]
        return "\n".join([_fit_text(self.fit), *usual, *messages])


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


def _fit_text(found: Fit) -> str:
    remaining = found.remaining_fraction
    rows = [
        (name, f"{value:.5g}", f"{std:.3g}", f"{low:.4g} .. {high:.4g}", unit, left)
        for name, value, std, low, high, unit, left in zip(
            found.names,
            found.values,
            found.std,
            *found.interval,
            found.units,
            [f"{remaining[n]:.0%}" if n in remaining else "" for n in found.names],
            strict=True,
        )
    ]
    table = format_table(
        ("parameter", "value", "std", "90 % interval", "unit", "posterior/prior"), rows
    )
    warnings = "\n".join(f"! {text}" for text in found.warnings)
    head = f"{found.method}, {found.rows_used} rows, channels: {', '.join(found.channels)}"
    return f"{head}\n\n{table}\n{warnings}".rstrip()
