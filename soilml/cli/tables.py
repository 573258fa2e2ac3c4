"""Tables of measured rows as commands read them: progress, the rows and the gear, hints."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from soilml.cli.output import tell
from soilml.cli.progress import progress_bar, working
from soilml.config.case import Case, case_of_one_gear, read_case
from soilml.errors import FitError, InputError
from soilml.io.read_table import FILLED, read_table
from soilml.io.table import Table
from soilml.log_import.checks.table_hints import table_remarks
from soilml.physics.effects import EFFECTS, Effect

Result = TypeVar("Result")

#: Size of a file, bytes, from which on its reading takes more than about a second.
_LONG = 10_000_000


def read_long_table(path: str, need: Sequence[str] = (), **options: Any) -> Table:
    """What `read_table` gives, with progress where the file is long."""
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        size = 0
    if size < _LONG or path.endswith(".parquet"):
        return read_table(path, need, **options)
    with progress_bar(f"reading {Path(path).name}", size) as done:
        return read_table(path, need, progress=done, **options)


def read_rows(
    args: argparse.Namespace, need: Sequence[str], filled: Sequence[str] = FILLED
) -> Table:
    """The rows of the table `args.runs` that `--where` and `--gear` select; see `read_table`."""
    table = read_long_table(args.runs, need, filled=filled, ignore_extra=args.ignore_extra)
    if args.where is not None:
        name, equals, value = args.where.partition("=")
        if not equals:
            raise InputError(
                f"--where is {args.where!r}; needed is COLUMN=VALUE, such as run=sand_3"
            )
        table = table.where(name, value)
    if args.gear is not None and "gear" in table and any(table["gear"] != ""):
        table = table.where("gear", args.gear)
    return table


def read_case_of_rows(
    args: argparse.Namespace,
    path: str,
    table: Table | None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    with_bias: bool = True,
    with_explanations: bool = False,
    several: bool = False,
) -> Case:
    """The case of one gear: that of `--gear`, or the one that all rows name.

    several: Whether the case may have all gears of the file where `--gear` names none.

    Raises `InputError` where the file has several gears and neither says which.
    """
    case = read_case(path, effects, with_bias, with_explanations=with_explanations)
    if several and args.gear is None:
        return case
    names = [] if table is None or "gear" not in table else list(dict.fromkeys(table["gear"]))
    gear: str | None = args.gear
    if case.gears and gear is None and len(names) == 1 and names[0]:
        gear = str(names[0])
    if not case.gears and any(names):
        gear = None  # it has selected rows
    return case_of_one_gear(case, path, gear)


def print_table_hints(table: Table, case: Case | None, radius: float | None = None) -> None:
    """Print a line on standard error for each oddity of a table; see `table_remarks`."""
    for remark in table_remarks(table, case, radius):
        tell(f"! {remark}")


def result_by_group(
    args: argparse.Namespace, table: Table, doing: str, answer: Callable[[Table], Result]
) -> tuple[dict[str, Result], dict[str, str]]:
    """The result of each group of --by that has one, and why the others have none.

    Without --by there is one result, under "". `doing` is the work in a word, such as identifying.

    Raises `FitError` where no group has a result.
    """
    if args.by is None:
        with working(f"{doing} from {len(table)} rows"):
            return {"": answer(table)}, {}
    found, failed = {}, {}
    groups = list(table.groups(args.by))
    with progress_bar(f"{doing} by {args.by}", len(groups)) as done:
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


def tell_failures(by: str | None, failed: Mapping[str, str]) -> None:
    """Print why groups have no result."""
    for name, why in failed.items():
        tell(f"{by} {name} has no result: {why}")
