"""Output of a command: a file, CSV or JSON into a pipe, or an aligned table on a terminal."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output
from soilml.io.text_tables import csv_blocks, format_table


def write_columns(columns: Mapping[str, Any], out: str | None) -> None:
    """Write the columns to the CSV file `out`; without one, print them."""
    if out is not None:
        with atomic_output(out) as part, part.open("w", encoding="utf-8") as opened:
            opened.writelines(csv_blocks(columns))
        count = len(next(iter(columns.values())))
        print(f"{count} row{'' if count == 1 else 's'} written to {out}", file=sys.stderr)
    else:
        for text in [f"{format_columns(columns)}\n"] if is_terminal() else csv_blocks(columns):
            write_stdout(text)


def is_terminal() -> bool:
    """Whether standard output is a terminal."""
    return sys.stdout is not None and sys.stdout.isatty()


def write_stdout(text: str) -> None:
    """Write text to standard output; raises `InputError` where that is closed."""
    if sys.stdout is None:
        raise InputError("standard output is closed: open it, or give --out where there is one")
    sys.stdout.write(text)


def json_text(content: Any) -> str:
    """The content as indented JSON; numbers that are not finite become null, as JSON has none."""
    return json.dumps(finite_or_null(content), indent=2, allow_nan=False) + "\n"


def finite_or_null(value: Any) -> Any:
    """The content with None for every number that is not finite."""
    if isinstance(value, dict):
        return {key: finite_or_null(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_null(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def format_columns(columns: Mapping[str, Any]) -> str:
    """The columns as an aligned table with four significant digits, text columns first."""
    text = [name for name, values in columns.items() if np.asarray(values).dtype.kind in "US"]
    order = [*text, *[name for name in columns if name not in text]]
    rows = zip(*[[_short(v) for v in columns[name]] for name in order], strict=True)
    return format_table(order, list(rows), text_columns=len(text))


def _short(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return "" if np.isnan(value) else f"{value:.4g}"
