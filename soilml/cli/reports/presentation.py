"""What a result is written as, and the one function that writes results of any kind."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from soilml.cli.output import is_terminal, show, tell, write_stdout
from soilml.cli.reports.report_files import write_with_report
from soilml.io.text_tables import csv_text
from soilml.report.figure_style import save_png
from soilml.report.page import Report


class Plotted(Protocol):
    """A result that draws itself."""

    def plot(self, ax: Any = None) -> Any:
        """Draw into axes."""


Result = TypeVar("Result", bound=Plotted)


@dataclass(frozen=True)
class Presentation(Generic[Result]):
    """What one kind of result is written as.

    Attributes
    ----------
    columns
        The CSV table of a result, in SI units.
    text
        Tables and warnings for a terminal.
    warnings
        The warnings alone.
    page
        The page of results by group, the column of the groups, model file and table.
    panels
        Rows and columns of axes that `plot` takes, and the size of the figure, inches.
    """

    columns: Callable[[Result], Mapping[str, Any]]
    text: Callable[[Result], str]
    warnings: Callable[[Result], Sequence[str]]
    page: Callable[[Mapping[str, Result], str | None, tuple[str, str]], Report]
    panels: Callable[[Result], tuple[int, int, tuple[float, float]]]


def write_results(
    args: argparse.Namespace,
    found: Mapping[str, Result],
    how: Presentation[Result],
    failed: Mapping[str, str],
) -> None:
    """Write --out, --picture and --report as one set; then text, or CSV into a pipe.

    Parameters
    ----------
    found
        Results by group of --by; one under "" without groups.
    failed
        Why other groups have none.
    """
    columns = _joined(args.by, found, how)

    def draw(path: Path) -> None:
        (only,) = found.values()
        rows, across, size = how.panels(only)
        save_png(only.plot, rows, across, size, path)

    def build() -> tuple[Report, Mapping[str, Any]]:
        content = {
            "columns": {name: values.tolist() for name, values in columns.items()},
            "warnings": {name: list(how.warnings(one)) for name, one in found.items()},
            "failed": dict(failed),
        }
        return how.page(found, args.by, (args.model, args.runs)), content

    table = csv_text(columns)
    write_with_report(args, {args.out: table, args.picture: draw}, build)
    heads = {name: f"{args.by} {name}: " if args.by else "" for name in found}
    if args.out is None and args.report is None and not is_terminal():
        write_stdout(table)
        for name, one in found.items():
            for line in how.warnings(one):
                tell(f"{heads[name]}{line}")
    else:
        show("\n\n".join(heads[name] + how.text(one) for name, one in found.items()))
    for name, why in failed.items():
        tell(f"{args.by} {name} has no result: {why}")


def _joined(
    by: str | None, found: Mapping[str, Result], how: Presentation[Result]
) -> dict[str, Any]:
    """The columns of all groups, one below the other, after a column of their names."""
    parts: list[dict[str, Any]] = []
    for name, one in found.items():
        own = how.columns(one)
        count = len(next(iter(own.values())))
        parts.append(({by: np.full(count, name)} if by else {}) | dict(own))
    return {key: np.concatenate([np.asarray(part[key]) for part in parts]) for key in parts[0]}
