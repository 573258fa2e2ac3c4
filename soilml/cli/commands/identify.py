"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from soilml.cli.advice_text import after_fit
from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.cli.output import put, watched
from soilml.config.case import read_case
from soilml.errors import FitError, InputError
from soilml.experiment_design import Advice, is_identified
from soilml.experiment_design.messages import next_row_messages, summary
from soilml.identification.fit_result import Fit
from soilml.io.atomic_files import named, save_text
from soilml.io.read_table import FILLED, RUNS, read_table
from soilml.io.table import Table
from soilml.io.text_tables import aligned
from soilml.optional_imports import need

HELP = "soil parameters from measured rows, by least squares on a model"
DESCRIPTION = """\
Find soil parameters with which MODEL.toml explains the rows of RUNS.csv.

  soilml identify MODEL.toml RUNS.csv --out found.json
  soilml identify MODEL.toml RUNS.csv --free cohesion,friction_angle,shear_modulus
  soilml identify MODEL.toml RUNS.csv --method linear --where run=sand_3

RUNS.csv needs the columns run, slip, load_N, torque_Nm (blank where not measured) and may have
drawbar_pull_N, sinkage_m, and <column>_std, of slip and load too. Rows whose status is not ok are
left out. All rows are taken for one soil; --by run identifies each run on its own, and says which
have no answer. What has a prior is found, unless --free names other parameters. Methods:
nonlinear (least squares on the full integrals, bounded, several starts), linear (c and phi from
sinkage, K given), newton (phi, K and kphi on the closed form, c given), posterior (mean, std and
90 % interval of everything that the rows, their noise and the prior allow: no method does better on
average, and it says what the rows do not tell and which next row would). A channel takes part where
its noise is declared. The answer is JSON: into --out, or into a pipe; a terminal shows a table.
Read the warnings: they say what the rows cannot tell. `left of prior` is the width that the rows
leave of the prior's; std is the expected distance to the truth, larger where the value of least
squares stands anywhere in an open range.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("runs", metavar="RUNS.csv", help="measured rows, CSV or Parquet")
    parser.add_argument(
        "--method", default="nonlinear", help="nonlinear, linear, newton or posterior"
    )
    parser.add_argument("--free", metavar="A,B,...", help="parameters to find")
    add_effects_option(parser)
    parser.add_argument("--by", metavar="run", help="one answer for each value of this column")
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.json", help="where to write the answer")


def add_row_options(parser: argparse.ArgumentParser) -> None:
    """Options that choose rows and forgive columns."""
    parser.add_argument("--where", metavar="COLUMN=VALUE", help="take these rows alone")
    parser.add_argument("--ignore-extra", action="store_true", help="pass over unknown columns")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return named(args.out, ".json")


def run(args: argparse.Namespace) -> int:
    """Identify and deliver the answer."""
    need("scipy", "identify")
    from soilml.identification import identify

    case = read_case(args.model, chosen_effects(args))
    table = chosen_rows(args, RUNS)
    free = None if args.free is None else [name.strip() for name in args.free.split(",")]
    failed: dict[str, str] = {}

    def solve(rows: Table) -> Answer:
        fit = identify(case, rows, free, args.method)
        if fit.method != "posterior":
            return Answer(fit)
        return Answer(fit, after_fit(case, rows, free, fit))

    if args.by is None:
        found = {"": solve(table)}
        content = found[""].as_json()
    else:
        found, failed = _by(table.groups(args.by), solve)
        if not found:
            name, why = next(iter(failed.items()))
            raise FitError(f"no {args.by} can be identified; {args.by} {name}: {why}")
        runs = {name: answer.as_json() for name, answer in found.items()}
        content = {"by": args.by, "runs": runs, "failed": failed}
    text = json.dumps(content, indent=2) + "\n"
    if args.out is not None:
        save_text(args.out, text)
    if args.out is not None or watched():
        heads = {name: f"{args.by} {name}: " if name else "" for name in found}
        print("\n\n".join(heads[name] + answer.for_people() for name, answer in found.items()))
    else:
        put(text)
    for name, why in failed.items():
        print(f"{args.by} {name} has no answer: {why}", file=sys.stderr)
    return 0


@dataclass(frozen=True)
class Answer:
    """A fit and, where the posterior found it, what to drive next."""

    fit: Fit
    advice: Advice | None = None

    def as_json(self) -> dict[str, Any]:
        """The content of the file, for one fit."""
        content = self.fit.as_json()
        if self.advice is not None:
            told_ones = zip(self.advice.names, is_identified(self.advice.now).tolist(), strict=True)
            content |= {"told": dict(told_ones), "advice": summary(self.advice)}
        return content

    def for_people(self) -> str:
        """The fit as a table, its warnings, and what to drive next in words."""
        said = [] if self.advice is None else ["", *next_row_messages(self.advice)]
        return "\n".join([_for_people(self.fit), *said])


def _by(
    groups: Iterable[tuple[str, Table]], solve: Callable[[Table], Answer]
) -> tuple[dict[str, Answer], dict[str, str]]:
    """The answer for each group, and why others have none."""
    found, failed = {}, {}
    for name, rows in groups:
        try:
            found[name] = solve(rows)
        except FitError as error:
            failed[name] = str(error)
    return found, failed


def chosen_rows(
    args: argparse.Namespace, need_columns: tuple[str, ...], filled: Sequence[str] = FILLED
) -> Table:
    """The rows of the table that `--where` leaves."""
    table = read_table(args.runs, need_columns, filled=filled, ignore_extra=args.ignore_extra)
    if args.where is None:
        return table
    name, equals, value = args.where.partition("=")
    if not equals:
        raise InputError(f"--where is {args.where!r}; needed is COLUMN=VALUE, such as run=sand_3")
    return table.where(name, value)


def _for_people(found: Fit) -> str:
    rows = [
        (name, f"{value:.5g}", f"{std:.3g}", f"{low:.4g} .. {high:.4g}", unit, left)
        for name, value, std, low, high, unit, left in zip(
            found.names,
            found.values,
            found.std,
            *found.interval,
            found.units,
            [f"{found.left[n]:.0%}" if n in found.left else "" for n in found.names],
            strict=True,
        )
    ]
    table = aligned(("parameter", "value", "std", "90 % interval", "unit", "left of prior"), rows)
    said = "\n".join(f"! {text}" for text in found.warnings)
    head = f"{found.method}, {found.rows_used} rows, channels: {', '.join(found.channels)}"
    return f"{head}\n\n{table}\n{said}".rstrip()
