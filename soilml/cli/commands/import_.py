"""`soilml import`: logs of rigs and rovers become a table of runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import SEVERAL, InputFile
from soilml.errors import InputError
from soilml.io.atomic_files import output_files, save_text

FORMATS = ("table", "csv", "json")
#: Endings of the table, its report and the errors that all rows share.
SUFFIXES = (".csv", ".report.html", ".report.json", ".bias.toml")
DESCRIPTION = """\
Bring raw logs into the table RUNS.csv that identify, estimate and gap read:
slip, torque and load of each wheel in each steady window, with standard
deviations.

  soilml import --init LOG... --out MAP.toml      look at the logs, write a map
  soilml import LOG... --map MAP.toml --out RUNS.csv

Logs are CSV and other text, Parquet, spreadsheets (.xlsx; one sheet of several
as BOOK.xlsx#SHEET), MATLAB files, MCAP and bags of ROS 1 and 2 (pip install
'.[logs]'); each file is a run, unless the map says otherwise. MAP.toml says
which column or topic is which quantity, in which unit, and what stands
between: radius, gear ratio, torque constant, tare, each with its uncertainty.
--init writes one with guesses and their reasons; without --out it prints it. A
guess that neither its name and unit nor another channel supports is marked
with CHANGE; --explain prints the evidence.

Beside RUNS.csv stand RUNS.report.html (pictures, what was left out and why),
RUNS.report.json, and RUNS.bias.toml: the errors that all rows share, as [bias]
of a model file. A map that cannot be right is refused with the likely cause;
--accept imports it as it is.
"""
_MOST_NAMED = 4  # Most logs that the next command names
ARGUMENTS = (
    ("files LOG", "logs, of any kind", InputFile, SEVERAL),
    ("--init", "write a commented map with guesses, and no table"),
    ("--explain", "with --init: print the evidence for each guess"),
    ("--map MAP.toml", "how the logs are read", InputFile),
    ("--out RUNS.csv", "write table and report; with --init, the map"),
    ("--accept", "import although the map looks wrong"),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    if args.init:
        if args.map is not None:
            raise InputError("--init writes a map and reads none; give its name as --out MAP.toml")
        if args.out is not None and Path(args.out).exists():
            raise InputError(f"{args.out} exists; --init would overwrite it: give another name")
        return output_files(args.out, ".toml")
    if args.explain:
        raise InputError("--explain prints the evidence for each guess of --init; give both")
    if args.map is None:
        raise InputError("--map is missing; soilml import --init LOG... --out MAP.toml writes one")
    return output_files(args.out, *SUFFIXES)


def run(args: argparse.Namespace) -> int:
    """Write the map, or the table and its report."""
    from soilml.cli.output import deliver, origin_of, tell
    from soilml.cli.progress import stage_progress
    from soilml.log_import.workflow import import_log
    from soilml.optional_imports import need
    from soilml.report.page import json_text, page, report_entry

    need("pint", "import")
    if args.init:
        return _init(args)
    if args.out is not None:
        for library in ("jinja2", "matplotlib"):
            need(library, "import")
    others: dict[str, str] = {}
    with stage_progress() as progress:
        found = import_log(args.files, args.map, accept=args.accept, progress=progress)
        report = found.report()
        if args.out is not None:
            progress("drawing the report", 0, 1)
            origin = origin_of(args)
            entry = {"report": report_entry(report, origin)}
            texts = page(report, origin), json_text(found.as_json() | entry), found.bias_toml()
            names = map(str, output_files(args.out, *SUFFIXES)[1:])
            others = dict(zip(names, texts, strict=True))
    deliver(args, report, found.as_json(), found.table.columns, others=others)
    if others:
        html, _, bias = others
        tell(
            f"\n{args.out} written; report: {html}; errors that all rows share, for the model "
            f"file: {bias}. Next: soilml identify MODEL.toml {args.out}"
        )
    return 0


def _init(args: argparse.Namespace) -> int:
    import shlex
    from contextlib import suppress

    from soilml.cli.output import tell, write_stdout
    from soilml.cli.progress import stage_progress
    from soilml.log_import.guesses.map_guess import draft_map
    from soilml.log_import.soil_tests import read_soil_tests

    with stage_progress() as progress:
        draft = draft_map(args.files, progress)
    if args.explain:
        tell(draft.evidence.rstrip())
    if args.out is None:
        write_stdout(draft.text)
        return 0
    save_text(args.out, draft.text)
    lines = "1 line needs" if draft.marked == 1 else f"{draft.marked} lines need"
    todo = f"{lines} a look (CHANGE, NEEDED)" if draft.marked else "look at its guesses"
    logs = [str(file) for file in args.files]
    shown = shlex.join(logs) if len(logs) <= _MOST_NAMED else "LOG..."
    tell(f"{args.out} written; {todo}; then: soilml import {shown} --map {args.out} --out runs.csv")
    if len(logs) == 1 and "each_row = true" in draft.text:
        with suppress(InputError):  # of a table that is none of tests
            if read_soil_tests(logs[0]):
                tell(f"plate or shear tests without a wheel are for: soilml bevameter {shown}")
    return 0
