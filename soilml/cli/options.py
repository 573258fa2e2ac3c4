"""Options and arguments that several commands share: their declarations.

This module and those of `soilml.cli.commands` import nothing that takes time, so that help and
errors of usage answer at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from soilml.cli.output_names import REPORT_FILES
from soilml.errors import InputError
from soilml.io.cell_text import read_number, read_whole_number


class InputFile(str):
    """Value of an argument that names a file to be read: `type=InputFile` in its declaration.

    The command line refuses an output that is the same file as one of these. Other text arguments
    may be equal to the name of an output.
    """

    __slots__ = ()


def add_effects_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--effects`."""
    parser.add_argument(
        "--effects",
        type=InputFile,
        metavar="FILE.py",
        help="Python file with effects of your own, which [[effect]] may then name; it is executed",
    )


def add_report_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--report`, whose files `report_outputs` names."""
    parser.add_argument(
        "--report",
        metavar="FOLDER",
        help="folder for report.html, a page with picture, table and warnings, and report.json",
    )


def report_outputs(args: argparse.Namespace) -> list[Path]:
    """The files of `--report`, where the folder exists already."""
    return folder_outputs("--report", args.report, REPORT_FILES)


def folder_outputs(option: str, path: str | None, names: Sequence[str]) -> list[Path]:
    """The files of an output folder, where it exists; `InputError` where it is no folder."""
    if path is None:
        return []
    if not path:
        raise InputError(f"{option} is empty; needed is a folder")
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{option} {path} is a file; needed is a folder")
    return [folder / name for name in names] if folder.is_dir() else []


def input_files(args: argparse.Namespace) -> list[str]:
    """Every file that a command reads: the arguments that are declared as `InputFile`."""
    lists = (v if isinstance(v, list) else [v] for v in vars(args).values())
    return [value for values in lists for value in values if isinstance(value, InputFile)]


def add_gear_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--gear`."""
    parser.add_argument(
        "--gear", metavar="NAME", help="which of the gears [gears.NAME], where MODEL.toml has some"
    )


def add_ignore_extra_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--ignore-extra`."""
    parser.add_argument(
        "--ignore-extra", action="store_true", help="ignore columns whose names are not known"
    )


def add_row_options(parser: argparse.ArgumentParser) -> None:
    """Declare `--where` and `--ignore-extra`, which `table_reading.read_rows` follows."""
    parser.add_argument("--where", metavar="COLUMN=VALUE", help="use only the rows with this value")
    add_ignore_extra_option(parser)


def add_seed_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--seed`, which `option_values.check_seed` checks."""
    parser.add_argument(
        "--seed", type=whole_number, default=0, help="seed of the random numbers (default: 0)"
    )


def add_cost_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--cost`, which `option_values.parse_costs` reads."""
    parser.add_argument(
        "--cost",
        metavar="KIND=NUMBER",
        action="append",
        default=[],
        help="cost of a kind of run to add, in any unit (default: 1); can be repeated",
    )


def add_workers_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--workers`."""
    parser.add_argument(
        "--workers",
        type=positive_number,
        metavar="N",
        help="number of processes (default: one for each core)",
    )


def number(text: str) -> float:
    """A finite number; raises `ArgumentTypeError` for anything else."""
    try:
        return read_number(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} given; needed is a number") from None


def whole_number(text: str) -> int:
    """A whole number; raises `ArgumentTypeError` for anything else."""
    try:
        return read_whole_number(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} given; needed is a whole number") from None


def positive_number(text: str) -> int:
    """A whole number above zero; raises `ArgumentTypeError` for anything else."""
    if not text.isascii() or not text.isdecimal() or not 1 <= len(text) <= 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} given; needed is a whole number, 1 or more")
    return int(text)
