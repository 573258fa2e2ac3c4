"""Numbers and arrays as C text."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Width of the lines that hold the numbers of an array.
WIDTH = 100
#: The largest whole number that every C compiler's int holds (32 bits).
LARGEST_INT = 2**31 - 1


def number(value: Any, kind: str) -> str:
    """One number of an element type (`float`, `double`, `int`, `bool`) as a C literal.

    Floating-point numbers are written with the digits that give back every bit.

    Examples
    --------
    >>> number(0.1, "float"), number(2, "double"), number(True, "bool")
    ('0.1f', '2.0', 'true')
    """
    if kind == "bool":
        return "true" if value else "false"
    if kind == "int":
        return str(int(np.clip(int(value), -LARGEST_INT, LARGEST_INT)))
    single = kind == "float"
    x = float(np.float32(value)) if single else float(value)
    if np.isnan(x):
        return "NAN" if single else "(double)NAN"
    if np.isinf(x):
        text = "INFINITY" if single else "(double)INFINITY"
        return text if x > 0 else f"-{text}"
    text = str(np.float32(value)) if single else repr(x)
    if not any(mark in text for mark in ".e"):
        text += ".0"
    return text + ("f" if single else "")


def array(name: str, values: NDArray[Any], kind: str) -> str:
    """The definition of a constant array."""
    numbers = ", ".join(number(value, kind) for value in values.reshape(-1))
    lines = textwrap.wrap(numbers, WIDTH - 4, break_on_hyphens=False, break_long_words=False)
    inside = "\n".join(f"    {line}" for line in lines)
    return f"static const {kind} {name}[{values.size}] = {{\n{inside}\n}};"
