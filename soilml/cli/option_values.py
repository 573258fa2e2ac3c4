"""Values of the options that several commands share."""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.cell_text import read_number, read_whole_number
from soilml.physics.effects import EFFECTS, Effect

#: Rows beyond which a table would not fit into the memory of a small machine.
MAX_ROWS = 10_000_000
#: A longer option value is cut in an error message.
_MAX_SHOWN = 80


def available_effects(args: argparse.Namespace) -> dict[str, type[Effect]]:
    """The catalogue of effects by name, with those of the file of `--effects`."""
    if args.effects is None:
        return dict(EFFECTS)
    from soilml.physics.user_effects import load_effects

    return {**EFFECTS, **load_effects(args.effects)}


def check_seed(args: argparse.Namespace) -> None:
    """Raise `InputError` for a negative `--seed`."""
    if args.seed < 0:
        raise InputError(f"--seed is {args.seed}; needed is a whole number, 0 or more")


def parse_costs(args: argparse.Namespace) -> dict[str, float]:
    """The costs of `--cost` by kind; raises `InputError` for a text that is not KIND=NUMBER."""
    costs = {}
    for text in args.cost:
        kind, _, number = text.rpartition("=")
        try:
            costs[kind] = read_number(number)
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
            if read_whole_number(count) > MAX_ROWS:
                raise InputError(f"{option} is {text!r}; at most {MAX_ROWS} values are possible")
            with np.errstate(all="ignore"):
                values = np.linspace(
                    read_number(start), read_number(stop), read_whole_number(count)
                ).round(12)
        else:
            values = np.asarray([read_number(part.strip()) for part in text.split(",")])
    except InputError:
        raise
    except ValueError:
        values = np.zeros(0)
    if values.size == 0 or not np.all(np.isfinite(values)):
        shown = text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."
        raise InputError(f"{option} is {shown!r}; needed is start:stop:count or values with commas")
    return values
