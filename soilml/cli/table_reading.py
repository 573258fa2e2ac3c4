"""Tables of measured rows as commands read them: with progress, and the rows of --where."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from soilml.cli.progress import progress_bar
from soilml.errors import InputError
from soilml.io.read_table import FILLED, read_table
from soilml.io.table import Table

#: Size of a file, bytes, from which on its reading takes more than about a second.
_LONG = 10_000_000


def read_long_table(path: str, need: Sequence[str] = (), **options: Any) -> Table:
    """What `read_table` gives, with progress where the file is long."""
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        size = 0
    if size < _LONG or path.endswith(".parquet"):
        return read_table(path, need, **options)
    with progress_bar(f"reading {Path(path).name}", size) as done:
        return read_table(path, need, progress=done, **options)


def read_rows(
    args: argparse.Namespace, need: Sequence[str], filled: Sequence[str] = FILLED
) -> Table:
    """The rows of the table `args.runs` that `--where` selects; see `read_table`."""
    table = read_long_table(args.runs, need, filled=filled, ignore_extra=args.ignore_extra)
    if args.where is None:
        return table
    name, equals, value = args.where.partition("=")
    if not equals:
        raise InputError(f"--where is {args.where!r}; needed is COLUMN=VALUE, such as run=sand_3")
    return table.where(name, value)
