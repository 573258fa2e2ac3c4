"""Everything soilml raises on purpose.

    SoilmlError                 one clear line; the command line ends with status 2
    ├── InputError              a value, a column or a setting given by the user is wrong
    │   └── TableError          ... in a table; the line names file, row and column
    ├── ModelFileError          an ONNX file is corrupt, foreign, or made for something else
    ├── FitError                the measurements cannot be fitted as asked
    └── MissingLibraryError     a library is not installed; the line says which extra brings it

Nothing *inside* a batch raises: a row that has no answer carries a `soilml.row_status.Status`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")
#: Characters of a message: names of files and columns in it may be of any number and length.
MOST_SHOWN = 1500
_BEGINNING = 1000  # Of them, what was given; the rest is the end, what is needed


def shortened(text: str) -> str:
    """A message without its middle, where it is longer than `MOST_SHOWN` characters.

    >>> len(shortened("x" * 10**6))
    1500
    """
    if len(text) <= MOST_SHOWN:
        return text
    return f"{text[:_BEGINNING]} ... {text[_BEGINNING + 5 - MOST_SHOWN :]}"


class SoilmlError(Exception):
    """Root of the tree: what was given, what is needed, a hint, in one line of bounded length."""

    def __str__(self) -> str:
        return shortened(super().__str__())


class InputError(SoilmlError, ValueError):
    """A value, a column or a setting given by the user is wrong."""


class TableError(InputError):
    """A table cannot be read as measurements; names file, row and column."""


class ModelFileError(SoilmlError):
    """An ONNX file is corrupt, foreign, or made for something else."""


class FitError(SoilmlError):
    """The measurements cannot be fitted as asked."""


class MissingLibraryError(SoilmlError, ImportError):
    """A library is not installed; the message says which extra brings it."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A question with the nearest of the known names, to be followed by them; empty without one.

    >>> did_you_mean("slip_sinkage", ["slip-sinkage", "grousers"])
    "did you mean 'slip-sinkage'? "
    >>> did_you_mean("sand", ["grousers"])
    ''
    """
    from difflib import get_close_matches

    near = get_close_matches(name, list(known), 1, 0.5)
    return f"did you mean {near[0]!r}? " if near else ""


def raised(answer: T | InputError) -> T:
    """The answer; an `InputError` in its place is raised."""
    if isinstance(answer, InputError):
        raise answer
    return answer


@contextmanager
def solvable(what: str) -> Iterator[None]:
    """Inside, matrices that cannot be factored raise `FitError` naming what was computed.

    Also a decorator. Such matrices come of readings, noise or parameters many orders of magnitude
    apart, which no check of single values finds.
    """
    import numpy as np

    try:
        yield
    except np.linalg.LinAlgError as error:
        raise FitError(
            f"{what} has no solution for these rows ({error}): check the units of the columns, and "
            "that the declared noise is that of the sensors"
        ) from None
