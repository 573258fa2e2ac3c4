"""Options and arguments that several commands share: their declarations and their values.

This module and those of commands import what takes time inside functions, so that help and errors
of usage answer at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.option_values import whole_number_from
from soilml.errors import InputError
from soilml.io.atomic_files import output_files

if TYPE_CHECKING:
    from soilml.config.case import Case
    from soilml.physics.effects import Effect
    from soilml.physics.soils.gravity_law import GravityChange

FILE_SUFFIXES = (".html", ".json", ".csv", ".toml", ".pdf")  # Of no folder that is made
REPORT_FILES = ("report.html", "report.json")  # Files of the folder of --report


class InputFile(str):
    """Value of an argument that names a file to be read: `type=InputFile` in its declaration.

    The command line refuses an output that is the same file as one of these. Other text arguments
    may be equal to the name of an output.
    """

    __slots__ = ()


class OutputFile(str):
    """Value of an argument that names a file to be written; see `add_output`."""

    __slots__ = ()


def add_output(
    parser: argparse.ArgumentParser, name: str, file: str, text: str, other: str = ""
) -> None:
    """Declare an option or argument for an output, whose ending is that of `file`, or `other`."""
    suffix = Path(file).suffix

    def checked(path: str) -> OutputFile:
        try:
            output_files(path, other if other and path.lower().endswith(other) else suffix)
        except InputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return OutputFile(path)

    short = ("-o",) if name == "--out" else ()
    parser.add_argument(*short, name, type=checked, metavar=file, help=text)


def is_json(args: argparse.Namespace) -> bool:
    """Whether the output is JSON, by its ending; raises `InputError` where --format differs."""
    found = args.out.lower().endswith(".json")
    wanted = {"json": True, "csv": False}.get(args.format or "", found)
    if wanted != found:
        raise InputError(f"--format {args.format} and --out {args.out} differ: omit --format")
    return bool(found)


def add_screen_options(parser: argparse.ArgumentParser, formats: Sequence[str] = ()) -> None:
    """Declare -q and -v, and --format where a command prints a result in these formats."""
    if formats:
        parser.add_argument(
            "--format",
            choices=formats,
            help="form of the result on standard output; tables of rows are CSV into a pipe",
        )
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="print no remarks on standard error"
    )
    parser.add_argument(
        "-v", "--verbose", action="store_true", help="print all details of the result"
    )


def declared_outputs(args: argparse.Namespace) -> list[Path]:
    """The arguments that are declared by `add_output`, and the files of `--report`.

    A command whose outputs are others has a function `outputs` in the place of this one.
    """
    declared = [Path(value) for value in vars(args).values() if isinstance(value, OutputFile)]
    return declared + folder_outputs("--report", getattr(args, "report", None), REPORT_FILES)


def add_model_and_runs(parser: argparse.ArgumentParser, *, need_runs: bool = True) -> None:
    """Declare MODEL.toml and RUNS.csv."""
    parser.add_argument(
        "model", type=InputFile, metavar="MODEL.toml", help="gear, soil, priors and noise"
    )
    parser.add_argument(
        "runs",
        type=InputFile,
        metavar="RUNS.csv",
        nargs=None if need_runs else "?",
        help="measured rows: CSV, Parquet or .xlsx",
    )


def add_exact_model_option(parser: argparse.ArgumentParser) -> None:
    """Declare --exact-model."""
    parser.add_argument(
        "--exact-model",
        action="store_true",
        help="assume a perfect model, and sensors exactly as in MODEL.toml",
    )


def add_gravity_options(parser: argparse.ArgumentParser) -> None:
    """Declare --gravity, --tested-at and --gravity-law, which `gravity_change` reads."""
    parser.add_argument(
        "--gravity",
        metavar="G",
        help="gravity that is predicted for: earth, moon, mars, or in m/s^2",
    )
    parser.add_argument(
        "--tested-at",
        metavar="G",
        help="gravity of the rows (default: that of [rover], else earth)",
    )
    parser.add_argument(
        "--gravity-law",
        metavar="LAW",
        help="how the soil changes with gravity: open (default), constant or proportional",
    )


def gravity_change(args: argparse.Namespace, case: Case) -> GravityChange | None:
    """The gravity of the rows, the one that is asked for, and the law; None without --gravity.

    Raises `InputError` for a gravity or a law that is none, or an option without --gravity.
    """
    from soilml.config.wheeled_rover import GRAVITY, read_gravity
    from soilml.physics.soils.gravity_law import GravityChange

    if args.gravity is None:
        for option, value in (("tested-at", args.tested_at), ("gravity-law", args.gravity_law)):
            if value is not None:
                raise InputError(
                    f"--{option} needs --gravity, the gravity that is predicted for, such as moon"
                )
        return None
    tested = GRAVITY["earth"] if case.rover is None else case.rover.gravity
    if args.tested_at is not None:
        tested = read_gravity(args.tested_at)
    return GravityChange(tested, read_gravity(args.gravity), args.gravity_law or "open")


def add_by_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--by`, which `tables.result_by_group` follows."""
    parser.add_argument(
        "--by", metavar="COLUMN", help="one result for each value of this column, such as run"
    )


def add_effects_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--effects`."""
    parser.add_argument(
        "--effects",
        type=InputFile,
        metavar="FILE.py",
        help="Python file with effects of your own, which [[effect]] may then name; it is executed",
    )


def add_report_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--report`, whose files are `REPORT_FILES`."""
    parser.add_argument(
        "--report",
        metavar="FOLDER",
        help="folder for report.html, a page with picture, table and warnings, and report.json",
    )


def need_for_options(args: argparse.Namespace, command: str) -> None:
    """Raise `MissingLibraryError` where `--report` or `--picture` is given and lacks a library."""
    for option, libraries in (("report", ("jinja2", "matplotlib")), ("picture", ("matplotlib",))):
        if getattr(args, option, None) is not None:
            from soilml.optional_imports import need

            for library in libraries:
                need(library, f"{command} --{option}")


def folder_outputs(option: str, path: str | None, names: Sequence[str]) -> list[Path]:
    """The files of an output folder, where it exists; `InputError` where it is no folder."""
    if path is None:
        return []
    if not path:
        raise InputError(f"{option} is empty; needed is a folder")
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{option} {path} is a file; needed is a folder")
    if folder.suffix in FILE_SUFFIXES and not folder.exists():
        files = " and ".join(names[:2])
        raise InputError(
            f"{option} {path} is the name of a file; needed is a folder, for {files}: "
            f"{option} {folder.with_suffix('')}"
        )
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
    """Declare `--where`, `--gear` and `--ignore-extra`, which `tables.read_rows` follows."""
    parser.add_argument("--where", metavar="COLUMN=VALUE", help="use only the rows with this value")
    parser.add_argument(
        "--gear",
        metavar="NAME",
        help="use only the rows of this gear, and [gears.NAME] where the model file has several",
    )
    add_ignore_extra_option(parser)


def add_seed_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--seed`."""
    parser.add_argument(
        "--seed",
        type=whole_number_from(0),
        default=0,
        help="seed of the random numbers (default: 0)",
    )


def add_cost_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--cost`, which `parse_costs` reads."""
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
        type=whole_number_from(1),
        metavar="N",
        help="number of processes (default: one for each core)",
    )


def leaves(root: argparse.ArgumentParser, before: str = "") -> Iterator[tuple[str, Any]]:
    """Every command below a parser, by name, with its own parser."""
    below: Any = [a.choices for a in root._actions if a.metavar == "COMMAND"]
    for word, sub in (below[0] if below else {}).items():
        inner = list(leaves(sub, f"{before}{word} "))
        yield from inner or [(before + word, sub)]


def available_effects(args: argparse.Namespace) -> dict[str, type[Effect]]:
    """The catalogue of effects by name, with those of the file of `--effects`."""
    from soilml.physics.effects import EFFECTS

    if args.effects is None:
        return dict(EFFECTS)
    from soilml.io.toml_settings import read_settings
    from soilml.physics.user_effects import load_effects

    for file in input_files(args):  # a file that is executed runs for no command that is refused
        if file != args.effects and not Path(file).exists():
            raise InputError(f"{file}: there is no such file")
    if getattr(args, "model", None) is not None:
        read_settings(args.model)
    return {**EFFECTS, **load_effects(args.effects)}
