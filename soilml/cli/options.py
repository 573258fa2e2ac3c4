"""Options and arguments that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.read_table import FILLED, read_table
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS, Effect

#: Rows beyond which a table would not fit into the memory of a small machine.
MAX_ROWS = 10_000_000
#: A longer option value is cut in an error message.
_MAX_SHOWN = 80


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


def available_effects(args: argparse.Namespace) -> dict[str, type[Effect]]:
    """The catalogue of effects by name, with those of the file of `--effects`."""
    if args.effects is None:
        return dict(EFFECTS)
    from soilml.physics.effects.user_effects import load_effects

    return {**EFFECTS, **load_effects(args.effects)}


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
    """Declare `--where` and `--ignore-extra`, which `read_rows` follows."""
    parser.add_argument("--where", metavar="COLUMN=VALUE", help="use only the rows with this value")
    add_ignore_extra_option(parser)


def read_rows(
    args: argparse.Namespace, need: Sequence[str], filled: Sequence[str] = FILLED
) -> Table:
    """The rows of the table `args.runs` that `--where` selects; see `read_table`."""
    table = read_table(args.runs, need, filled=filled, ignore_extra=args.ignore_extra)
    if args.where is None:
        return table
    name, equals, value = args.where.partition("=")
    if not equals:
        raise InputError(f"--where is {args.where!r}; needed is COLUMN=VALUE, such as run=sand_3")
    return table.where(name, value)


def add_seed_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--seed`, which `check_seed` checks."""
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the random numbers (default: 0)"
    )


def check_seed(args: argparse.Namespace) -> None:
    """Raise `InputError` for a negative `--seed`."""
    if args.seed < 0:
        raise InputError(f"--seed is {args.seed}; needed is a whole number, 0 or more")


def add_cost_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--cost`, which `parse_costs` reads."""
    parser.add_argument(
        "--cost",
        metavar="KIND=NUMBER",
        action="append",
        default=[],
        help="cost of a kind of run to add, in any unit (default: 1); can be repeated",
    )


def parse_costs(args: argparse.Namespace) -> dict[str, float]:
    """The costs of `--cost` by kind; raises `InputError` for a text that is not KIND=NUMBER."""
    costs = {}
    for text in args.cost:
        kind, _, number = text.rpartition("=")
        try:
            costs[kind] = float(number)
        except ValueError:
            kind = ""
        if not kind:
            raise InputError(f"--cost {text!r}: needed is KIND=NUMBER, such as reverse=2")
    return costs


def parse_names(text: str | None) -> list[str] | None:
    """The names of `a,b,c`; None where the option is absent."""
    return None if text is None else [name.strip() for name in text.split(",")]


def parse_numbers(option: str, text: str) -> NDArray[np.float64]:
    """The numbers of `start:stop:count` or `a,b,c`; raises `InputError` naming the option."""
    try:
        if ":" in text:
            start, stop, count = text.split(":")
            if int(count) > MAX_ROWS:
                raise InputError(f"{option} is {text!r}; at most {MAX_ROWS} values are possible")
            with np.errstate(all="ignore"):
                values = np.linspace(float(start), float(stop), int(count)).round(12)
        else:
            values = np.asarray([float(part) for part in text.split(",")])
    except InputError:
        raise
    except ValueError:
        values = np.zeros(0)
    if values.size == 0 or not np.all(np.isfinite(values)):
        shown = text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."
        raise InputError(f"{option} is {shown!r}; needed is start:stop:count or values with commas")
    return values
