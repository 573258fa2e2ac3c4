"""Options and arguments that several commands share: their declarations and their values.

This module and those of commands import what takes time inside functions, so that help and errors
of usage answer at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from keyword import iskeyword
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
    """Value of an argument that names a file to be written, whose ending its metavar has."""

    __slots__ = ()


#: Further marks of an argument in its declaration; see `declare`.
REQUIRED, OPTIONAL, SEVERAL, ANY = (
    {"required": True}, {"nargs": "?"}, {"nargs": "+"}, {"nargs": "*"}
)  # fmt: skip
REPEATED: dict[str, Any] = {"action": "append", "default": []}
#: An argument: its words and what it means, then the type of its value and marks; or the name of
#: shared ones.
Argument = str | tuple[Any, ...]
_WORDS = re.compile(r"(\S+)(?: (.+?))??(?: \((.+)\))?")
#: Arguments that several commands share, by name.
SHARED: dict[str, tuple[Argument, ...]] = {
    "model": (("model MODEL.toml", "gear, soil, priors and noise", InputFile),),
    "model-and-runs": (
        "model",
        ("runs RUNS.csv", "measured rows: CSV, Parquet or .xlsx", InputFile),
    ),
    "model-and-any-runs": (
        "model",
        ("runs RUNS.csv", "measured rows: CSV, Parquet or .xlsx", InputFile, OPTIONAL),
    ),
    "exact-model": (
        ("--exact-model", "assume a perfect model, and sensors exactly as in the model file"),
    ),
    "gravity": (
        ("--gravity G", "gravity that is predicted for: earth, moon, mars, or in m/s^2"),
        ("--tested-at G", "gravity of the rows (default: that of [rover], else earth)"),
        ("--gravity-law LAW", "change of soil by gravity: open (default), constant, proportional"),
    ),
    "by": (("--by COLUMN", "one result for each value of this column, such as run"),),
    "free": (("--free A,B,...", "parameters to identify (default: those with a prior)"),),
    "effects": (
        ("--effects FILE.py", "effects of your own, which [[effect]] may name; runs it", InputFile),
    ),
    "report": (
        ("--report FOLDER", "folder for report.html, with picture, table, warnings, report.json"),
    ),
    "gear": (("--gear NAME", "which of the gears [gears.NAME] of the model file"),),
    "ignore-extra": (("--ignore-extra", "ignore columns whose names are not known"),),
    "rows": (
        ("--where COLUMN=VALUE", "use only the rows with this value"),
        ("--gear NAME", "use only the rows of this gear, and [gears.NAME] of the model file"),
        "ignore-extra",
    ),
    "seed": (("--seed N (0)", "seed of the random numbers", whole_number_from(0)),),
    "workers": (
        ("--workers N", "number of processes (default: one for each core)", whole_number_from(1)),
    ),
    "screen": (
        ("--quiet", "print no remarks and no progress"),
        ("--verbose", "print all details of the result"),
    ),
}
_SHORT = {"--out": "-o", "--quiet": "-q", "--verbose": "-v"}


def declare(parser: argparse.ArgumentParser, arguments: Iterable[Argument]) -> None:
    """Declare arguments by their words: `name METAVAR`, `--name METAVAR (default)`, or a switch.

    A metavar such as FILE.csv|.json says which endings an output may have.
    """
    for own in arguments:
        if isinstance(own, str):
            declare(parser, SHARED[own])
            continue
        words, text, *marks = own
        found = _WORDS.fullmatch(words)
        assert found is not None, words
        name, metavar, default = found.groups()
        given: dict[str, Any] = {"help": text}
        if name.startswith("-") and metavar is None:
            given["action"] = "store_true"
        elif metavar is not None:
            given["metavar"] = metavar.partition("|")[0]
        if default is not None:
            given |= {"default": default, "help": f"{text} (default: {default})"}
        for mark in marks:
            given |= mark if isinstance(mark, dict) else {"type": mark}
        if given.get("type") is OutputFile:
            given["type"] = partial(_output, metavar)
        if iskeyword(own_name := name.lstrip("-")):
            given["dest"] = f"{own_name}_"
        short = (_SHORT[name],) if name in _SHORT else ()
        parser.add_argument(*short, name, **given)


def _output(metavar: str, path: str) -> OutputFile:
    """An output with one of the endings of its metavar."""
    file, _, other = metavar.partition("|")
    try:
        output_files(path, other if other and path.lower().endswith(other) else Path(file).suffix)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return OutputFile(path)


def is_json(args: argparse.Namespace) -> bool:
    """Whether the output is JSON, by its ending; raises `InputError` where --format differs."""
    found = args.out.lower().endswith(".json")
    wanted = {"json": True, "csv": False}.get(getattr(args, "format", None) or "", found)
    if wanted != found:
        raise InputError(f"--format {args.format} and --out {args.out} differ: omit --format")
    return bool(found)


def declared_outputs(args: argparse.Namespace) -> list[Path]:
    """The arguments that are declared as `OutputFile`, and the files of `--report`.

    A command whose outputs are others has a function `outputs` in the place of this one.
    """
    declared = [Path(value) for value in vars(args).values() if isinstance(value, OutputFile)]
    return declared + folder_outputs("--report", getattr(args, "report", None), REPORT_FILES)


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
