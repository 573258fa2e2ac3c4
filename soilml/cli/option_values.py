"""Values of options: numbers in bounds, names and lists, each refused in one line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from soilml.errors import InputError
from soilml.io.bounds import ROWS
from soilml.io.cell_text import read_number, read_whole_number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAX_SHOWN = 80  # A longer option value is cut in an error message


@dataclass(frozen=True)
class NumberFrom:
    """The type of an option that is a number from `lower` to `upper`, in `unit`; or a whole one.

    Raises `ArgumentTypeError` for anything else.
    """

    lower: float
    upper: float
    unit: str = ""
    whole: bool = False

    def __call__(self, text: str) -> float:
        kind = "a whole number from " if self.whole else ""
        try:
            value = read_whole_number(text) if self.whole else read_number(text)
        except ValueError:
            value = None
        if value is None or not self.lower <= value <= self.upper:
            raise argparse.ArgumentTypeError(
                f"{text!r} given; needed is {kind}{self.lower:.10g} to {self.upper:.10g} "
                f"{self.unit}".rstrip()
            )
        return value


SLIP = NumberFrom(0.001, 0.999)  # A slip of a driving gear


def whole_number_from(lower: int, upper: int = 10**9) -> NumberFrom:
    """The type of an option that is a whole number in these bounds."""
    return NumberFrom(lower, upper, whole=True)


def named_numbers(texts: Sequence[str], option: str, needed: str) -> dict[str, float]:
    """Numbers by name from texts NAME=NUMBER; raises `InputError`, with what is `needed`."""
    found = {}
    for text in texts:
        name, _, number = map(str.strip, text.rpartition("="))
        try:
            found[name] = read_number(number)
        except ValueError:
            name = ""
        if not name:
            raise InputError(f"{option} {text!r}: needed is {needed}")
    return found


def parse_names(text: str | None) -> list[str] | None:
    """The names of `a,b,c`; None where the option is absent."""
    return None if text is None else [name.strip() for name in text.split(",")]


def parse_numbers(option: str, text: str) -> NDArray[np.float64]:
    """The numbers of `start:stop:count` or `a,b,c`; raises `InputError` naming the option."""
    import numpy as np

    try:
        if ":" in text:
            start, stop, count = text.split(":")
            if read_whole_number(count) > ROWS.most:
                raise InputError(f"{option} is {text!r}; at most {ROWS.most} values are possible")
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
