"""Output of a command: a file, CSV or JSON into a pipe, or an aligned table on a terminal."""

from __future__ import annotations

import argparse
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.cli.options import REPORT_FILES, input_files
from soilml.cli.screen import SCREEN, is_terminal
from soilml.errors import InputError
from soilml.io.atomic_files import write_files
from soilml.io.cell_text import escaped
from soilml.io.spreadsheet import split_sheet
from soilml.io.text_tables import WIDTH, csv_blocks, format_table, wrapped
from soilml.report.figure_style import save_png
from soilml.report.page import Content, Provenance, Report, json_text, report_texts
from soilml.report.terminal import rounded, shown_column

if TYPE_CHECKING:
    from soilml.report.column_panels import ColumnPanels
    from soilml.report.parameter_figure import ParameterIntervals

_ENDING = re.compile(r"_(std|p05|p95)$")
_MOST_TEXT = 44  # Most characters of a text cell on a terminal


def write_columns(
    columns: Mapping[str, Any],
    out: str | None,
    picture: str | None = None,
    panels: ColumnPanels | ParameterIntervals | None = None,
    others: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write the columns to the CSV file `out`; without one, print them.

    picture: PNG file of `panels`; None where the option was not given.
    others: Columns of further CSV files.
    """
    files: dict[Path, Content] = {}
    if out is not None:
        files[Path(out)] = partial(save_columns, columns)
    files |= {Path(name): partial(save_columns, table) for name, table in (others or {}).items()}
    if picture is not None and panels is not None:
        files[Path(picture)] = partial(save_png, panels.plot, *panels.shape, panels.size)
    write_files(files)
    tell_columns(columns, out)


def save_columns(columns: Mapping[str, Any], path: Path) -> None:
    """Write a CSV file, in blocks of rows."""
    with path.open("w", encoding="utf-8") as opened:
        opened.writelines(csv_blocks(columns))


def tell_columns(columns: Mapping[str, Any], out: str | None) -> None:
    """Say how many rows were written to `out`; without one, print them as table or CSV."""
    if out is not None:
        count = len(next(iter(columns.values())))
        tell(f"{count} row{'' if count == 1 else 's'} written to {out}")
        return
    form = SCREEN.form_of_rows()
    if form == "csv":
        for text in csv_blocks(columns):
            write_stdout(text)
        return
    content = {name: np.asarray(values).tolist() for name, values in columns.items()}
    write_stdout(f"{format_columns(columns)}\n" if form == "table" else json_text(content))


def show_verdict(text: str, out: str | None) -> None:
    """Print a verdict above a table that is about to be printed; not above CSV or JSON."""
    if out is None and SCREEN.form_of_rows() == "table":
        show(f"{text}\n")


def show_result(text: str, content: Mapping[str, Any]) -> None:
    """Print a result as text, into a pipe too, or as JSON where --format says so."""
    if SCREEN.form == "json":
        write_stdout(json_text(content))
    else:
        show(text)


def show(text: str) -> None:
    """Print text on standard output; sentences are broken to the width of a terminal."""
    text = escaped(text)
    write_stdout(f"{wrapped(text) if is_terminal() else text}\n")


def tell(text: str) -> None:
    """Print a message on standard error; broken to the width of a terminal, else one line."""
    if SCREEN.quiet:
        return
    text = escaped(text)
    print(
        wrapped(text) if sys.stderr is not None and sys.stderr.isatty() else text, file=sys.stderr
    )


def write_stdout(text: str) -> None:
    """Write text to standard output; raises `InputError` where that is closed."""
    if sys.stdout is None:
        raise InputError("standard output is closed: open it, or give --out where there is one")
    sys.stdout.write(text)


def origin_of(args: argparse.Namespace, files: Iterable[str] = ()) -> Provenance:
    """The command and its input files, of which `files` are some that no argument names."""
    read = (str(split_sheet(file)[0]) for file in (*input_files(args), *files))
    return Provenance.of(getattr(args, "command_line", []), read)


def write_with_report(
    args: argparse.Namespace,
    contents: Mapping[str | None, Content],
    build: Callable[[], tuple[Report, Mapping[str, Any]]],
    read: Iterable[str] = (),
) -> None:
    """Write the outputs of a command, and those of --report, as one set.

    contents: What is written to each path; None as a path is an option that was not given.
    build: Gives the report and the result in SI units; called where --report is given.
    read: Input files that no argument names.
    """
    files = {Path(path): content for path, content in contents.items() if path is not None}
    if args.report is not None:
        report, content = build()
        names = (REPORT_FILES[0], REPORT_FILES[1])
        files |= report_texts(report, origin_of(args, read), content, names, Path(args.report))
    write_files(files, folders=[args.report])


def format_columns(columns: Mapping[str, Any], width: int = WIDTH) -> str:
    """The columns as an aligned table, text first, in usual units and as many digits as are known.

    A standard deviation stands beside its value. Columns that do not fit into `width` characters
    are left out, and a line names them: ends of intervals first, then the last ones.
    """
    text = [name for name, values in columns.items() if np.asarray(values).dtype.kind in "US"]
    shown = {name: _cut_cells(columns[name]) for name in text}
    for name in columns:
        if name in text or (name.endswith("_std") and name.removesuffix("_std") in columns):
            continue
        cells = _cells(columns, name)
        if f"{name}_std" in columns:
            pairs = zip(cells, _cells(columns, f"{name}_std"), strict=True)
            cells = [f"{value} +- {std}" if value and std else value for value, std in pairs]
        shown[shown_column(name)[1]] = cells
    left_out = _left_out(shown, width)
    kept = [name for name in shown if name not in left_out]
    rows = list(zip(*(shown[name] for name in kept), strict=True))
    table = format_table(kept, rows, text_columns=len(text))
    if not left_out:
        return table
    names = textwrap.fill(f"not shown here, but with --out: {', '.join(left_out)}", width)
    return f"{table}\n{names}"


def _cells(columns: Mapping[str, Any], name: str) -> list[str]:
    """Cells of a column of numbers, rounded by its standard deviation or by its interval."""
    factor, _ = shown_column(name)
    values = np.asarray(columns[name])
    if values.dtype.kind in "b":
        return ["yes" if value else "no" for value in values]
    base = _ENDING.sub("", name)
    spread = np.zeros(values.size)
    if f"{base}_std" in columns:
        spread = np.asarray(columns[f"{base}_std"], dtype=float)
    elif f"{base}_p05" in columns and f"{base}_p95" in columns:
        spread = (np.asarray(columns[f"{base}_p95"]) - np.asarray(columns[f"{base}_p05"])) / 3.3
    pairs = zip(factor * values.astype(float), factor * np.nan_to_num(spread), strict=True)
    return [rounded(float(value), float(std)) for value, std in pairs]


def _cut_cells(values: Sequence[Any]) -> list[str]:
    return [t if len(t) <= _MOST_TEXT else f"{t[: _MOST_TEXT - 3]}..." for t in map(str, values)]


def _left_out(shown: Mapping[str, Sequence[str]], width: int) -> list[str]:
    """Names of the columns that do not fit, in their order."""
    widths = {name: max(map(len, (name, *cells))) + 2 for name, cells in shown.items()}
    order = [*reversed(list(shown))]
    first = [n for n in order if n.endswith(("_p05", "_p95"))]
    out: list[str] = []
    for name in dict.fromkeys([*first, *order]):
        if sum(widths[n] for n in shown if n not in out) - 2 <= width:
            break
        if name in ("in_range", "disagrees", "run") or len(out) == len(shown) - 1:
            continue
        out.append(name)
    return [name for name in shown if name in out]
