"""Where a command's table goes: a file, a pipe as CSV, or a person as an aligned table."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.io.atomic_files import save_text
from soilml.io.text_tables import aligned, csv_text


def deliver(columns: Mapping[str, Any], out: str | None) -> None:
    """Write the columns to `out`; without one, print them."""
    if out is not None:
        save_text(out, csv_text(columns))
        count = len(next(iter(columns.values())))
        print(f"{count} row{'' if count == 1 else 's'} written to {out}", file=sys.stderr)
    else:
        put(f"{for_people(columns)}\n" if watched() else csv_text(columns))


def watched() -> bool:
    """Whether a person looks at standard output."""
    return sys.stdout is not None and sys.stdout.isatty()


def put(text: str) -> None:
    """Write an answer to standard output; raises `InputError` where that is closed."""
    if sys.stdout is None:
        raise InputError("standard output is closed: open it, or give --out where there is one")
    sys.stdout.write(text)


def for_people(columns: Mapping[str, Any]) -> str:
    """The columns as an aligned table with four significant digits."""
    text = [name for name, values in columns.items() if np.asarray(values).dtype.kind in "US"]
    order = [*text, *[name for name in columns if name not in text]]
    rows = zip(*[[_short(v) for v in columns[name]] for name in order], strict=True)
    return aligned(order, list(rows), text_columns=len(text))


def _short(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return "" if np.isnan(value) else f"{value:.4g}"
