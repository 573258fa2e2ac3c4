"""`soilml import`: logs of rigs and rovers become a table of runs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from soilml.cli.options import InputFile
from soilml.cli.output_names import IMPORT_SUFFIXES
from soilml.errors import InputError
from soilml.io.atomic_files import output_files

HELP = "bring logs of a rig or a rover into a table of runs"
DESCRIPTION = """\
Bring raw logs into the table RUNS.csv that identify, estimate and gap read:
slip, torque and load of each wheel in each steady window, with standard
deviations.

  soilml import --init LOG... --out MAP.toml      look at the logs, write a map
  soilml import LOG... --map MAP.toml --out RUNS.csv

Logs are CSV and other text, Parquet, MATLAB files, MCAP and bags of ROS 1
and 2 (pip install 'soilml[logs]'); each file is a run, unless the map says
otherwise. MAP.toml says which column or topic is which quantity, in which unit,
and what stands between: radius, gear ratio, torque constant, tare, each with
its uncertainty. --init writes one with guesses and their reasons; without --out
it prints it.

Beside RUNS.csv stand RUNS.report.html (pictures, what was left out and why),
RUNS.report.json, and RUNS.bias.toml: the errors that all rows share, as [bias]
of a model file. A map that cannot be right is refused with the likely cause;
--accept imports it as it is.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("files", type=InputFile, metavar="LOG", nargs="+", help="logs, of any kind")
    parser.add_argument(
        "--init", action="store_true", help="write a commented map with guesses, and no table"
    )
    parser.add_argument("--map", type=InputFile, metavar="MAP.toml", help="how the logs are read")
    parser.add_argument(
        "--out", metavar="RUNS.csv", help="write the table and its report; with --init, the map"
    )
    parser.add_argument("--accept", action="store_true", help="import although the map looks wrong")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    if args.init:
        if args.map is not None:
            raise InputError("--init writes a map and reads none; give its name as --out MAP.toml")
        if args.out is not None and Path(args.out).exists():
            raise InputError(f"{args.out} exists; --init would overwrite it: give another name")
        return output_files(args.out, ".toml")
    if args.map is None:
        raise InputError("--map is missing; soilml import --init LOG... --out MAP.toml writes one")
    # `import *.csv` a second time finds the table of the first time among the logs
    others = [file for file in args.files if not _is_that_table(file, args.out)]
    if others and len(others) < len(args.files):
        print(f"! {args.out} is a table of runs and no log: it is written anew", file=sys.stderr)
        args.files = others
    return output_files(args.out, *IMPORT_SUFFIXES)


def _is_that_table(file: str, out: str | None) -> bool:
    """Whether a file is the table that is to be written, as an earlier import has written it."""
    if out is None or not Path(out).is_file() or not Path(out).samefile(file):
        return False
    with Path(file).open("rb") as opened:
        return opened.readline(200).startswith(
            (b"run,slip,", b"run,gear,slip,", b"run,wheel,slip,")
        )


def run(args: argparse.Namespace) -> int:
    """Write the map, or the table and its report."""
    from soilml.cli.execution.import_ import run

    return run(args)
