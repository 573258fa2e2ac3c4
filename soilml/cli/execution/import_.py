"""`soilml import`: logs of rigs and rovers become a table of runs."""

from __future__ import annotations

import argparse
import shlex

from soilml.cli.output import format_columns, is_terminal, json_text, tell, write_stdout
from soilml.cli.output_names import IMPORT_SUFFIXES
from soilml.cli.progress import stage_progress
from soilml.cli.reports.report_files import origin_of
from soilml.io.atomic_files import output_files, save_text, write_files
from soilml.io.text_tables import csv_text
from soilml.log_import.guesses.map_text import init_map
from soilml.log_import.result import ImportedLog
from soilml.log_import.workflow import import_log
from soilml.optional_imports import need

#: Columns of the table on the terminal; the file has all.
_SHOWN = ("run", "slip", "slip_std", "load_N", "torque_Nm", "torque_Nm_std", "drawbar_pull_N",
          "sinkage_m")  # fmt: skip
_MOST_SHOWN = 40
#: Most logs that the next command names.
_MOST_NAMED = 4


def run(args: argparse.Namespace) -> int:
    """Write the map, or the table and its report."""
    need("pint", "import")
    if args.init:
        return _init(args)
    if args.out is not None:
        for library in ("jinja2", "matplotlib"):
            need(library, "import")
    with stage_progress() as progress:
        found = import_log(args.files, args.map, accept=args.accept, progress=progress)
        html, entry = "", {}
        if args.out is not None:
            from soilml.log_import.page import page, summary

            origin = origin_of(args)
            html = page(found, progress, origin)
            entry = {"report": summary(found).as_json(origin)}
    _print_remarks(found)
    if args.out is None:
        _print_table(found)
        return 0
    files = output_files(args.out, *IMPORT_SUFFIXES)
    texts = (
        csv_text(found.table.columns),
        html,
        json_text(found.as_json() | entry),
        found.bias_toml(),
    )
    write_files(dict(zip(files, texts, strict=True)))
    if is_terminal():
        _print_table(found)
    tell(
        f"{_counted(len(found.table), 'row')} of {_counted(found.runs, 'run')} written to "
        f"{args.out}; report: {files[1]}; errors that all rows share, for the model file: "
        f"{files[3]}. Next: soilml identify MODEL.toml {args.out}"
    )
    return 0


def _counted(number: int, name: str) -> str:
    return f"{number} {name}{'s' * (number != 1)}"


def _init(args: argparse.Namespace) -> int:
    text = init_map(args.files)
    if args.out is None:
        write_stdout(text)
        return 0
    save_text(args.out, text)
    changes = sum("CHANGE" in line or "NEEDED" in line for line in text.splitlines()[3:])
    lines = "1 line needs" if changes == 1 else f"{changes} lines need"
    todo = f"{lines} a look (CHANGE, NEEDED)" if changes else "look at its guesses"
    logs = [str(file) for file in args.files]
    shown = shlex.join(logs) if len(logs) <= _MOST_NAMED else "LOG..."
    tell(f"{args.out} written; {todo}; then: soilml import {shown} --map {args.out} --out runs.csv")
    return 0


def _print_remarks(found: ImportedLog) -> None:
    for text in (*found.implausible, *found.remarks):
        tell(f"! {text}")
    if not found.series:
        return
    short = sum(stop.stop - stop.start for _, stop in found.left_out())
    tell(f"{short:.0f} s were left out; the report says why")


def _print_table(found: ImportedLog) -> None:
    table = found.table
    if not is_terminal():
        write_stdout(csv_text(table.columns))
        return
    columns = {name: table[name][:_MOST_SHOWN] for name in _SHOWN if name in table}
    more = f"and {len(table) - _MOST_SHOWN} more\n" if len(table) > _MOST_SHOWN else ""
    write_stdout(f"{format_columns(columns)}\n{more}")
