"""Output of a command: files, and the result as text, CSV or JSON on standard output."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.cli.options import REPORT_FILES, input_files, is_json
from soilml.cli.screen import SCREEN, is_terminal
from soilml.errors import InputError
from soilml.io.atomic_files import write_files
from soilml.io.cell_text import escaped
from soilml.io.spreadsheet import split_sheet
from soilml.io.text_tables import csv_blocks
from soilml.report.aligned_text import wrapped
from soilml.report.page import Content, Provenance, json_text, report_texts
from soilml.report.report import Report
from soilml.report.tables import ReportTable

if TYPE_CHECKING:
    from soilml.report.report import Picture


def write_columns(
    columns: Mapping[str, Any],
    out: str | None,
    picture: str | None = None,
    drawn: Picture | None = None,
) -> None:
    """Write the columns to the CSV file `out`; without one, print them.

    picture: PNG file of `drawn`; None where the option was not given.
    """
    files: dict[Path, Content] = {}
    if out is not None:
        files[Path(out)] = partial(save_columns, columns)
    if picture is not None and drawn is not None:
        files[Path(picture)] = drawn.save
    write_files(files)
    tell_columns(columns, out)


def deliver(
    args: argparse.Namespace,
    report: Report,
    content: Mapping[str, Any] | None = None,
    columns: Mapping[str, Any] | None = None,
    read: Iterable[str] = (),
    others: Mapping[str, Content] | None = None,
) -> None:
    """Write --out, --picture and --report as one set, and show the result.

    content: What JSON has, in SI units; by default the columns.
    columns: Rows of a table: --out is then CSV, unless it is FILE.json. Otherwise it is JSON.
    read: Input files that no argument names.
    others: What is written to --out in the place of these, and further files, by path.
    """
    table = {name: np.asarray(values).tolist() for name, values in (columns or {}).items()}
    content = table if content is None else content
    out, picture, folder = (getattr(args, n, None) for n in ("out", "picture", "report"))
    files: dict[Path, Content] = {}
    if out is not None:
        rows = None if columns is None or is_json(args) else columns
        files[Path(out)] = json_text(content) if rows is None else partial(save_columns, rows)
    if picture is not None:
        files[Path(picture)] = report.pictures[0].save
    if folder is not None:
        names = (REPORT_FILES[0], REPORT_FILES[1])
        files |= report_texts(report, origin_of(args, read), content, names, Path(folder))
    files |= {Path(path): own for path, own in (others or {}).items()}
    write_files(files, folders=[folder])
    if columns is None or SCREEN.form != "csv":
        show_result(report, {k: v for k, v in content.items() if k != "draws"})  # for files
        return
    tell_columns(columns, None)
    for text in (
        *(f"! {r.text}" for r in report.remarks),
        *map("next: {}".format, report.next_steps),
    ):
        tell(text)


def save_columns(columns: Mapping[str, Any], path: Path) -> None:
    """Write a CSV file, in blocks of rows."""
    with path.open("w", encoding="utf-8") as opened:
        opened.writelines(csv_blocks(columns))


def tell_columns(columns: Mapping[str, Any], out: str | None) -> None:
    """Say how many rows were written to `out`; without one, print them.

    A table begins with the status where one is not `ok`, and is without it otherwise.
    """
    if out is not None:
        count = len(next(iter(columns.values())))
        tell(f"{count} row{'' if count == 1 else 's'} written to {out}")
        return
    if SCREEN.form == "csv":
        for text in csv_blocks(columns):
            write_stdout(text)
        return
    if SCREEN.form == "json":
        content = {name: np.asarray(values).tolist() for name, values in columns.items()}
        write_stdout(json_text(content))
        return
    status = {"status": columns["status"]} if "status" in columns else {}
    first = status if any(v != "ok" for v in status.get("status", ())) else {}
    others = {name: values for name, values in columns.items() if name != "status"}
    write_stdout(f"{ReportTable.of('rows', first | others).text()}\n")


def show_result(report: Report, content: Mapping[str, Any], details: bool = False) -> None:
    """Print a report as text, or its content as JSON where --format says so.

    -v, or `details`, prints all of it, -q no remarks.
    """
    if SCREEN.form == "json":
        write_stdout(json_text(content))
        return
    show((replace(report, remarks=()) if SCREEN.quiet else report).text(details or SCREEN.verbose))


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
