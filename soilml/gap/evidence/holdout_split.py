"""Rows that a user holds out, which take no part in the analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.table import Table

#: `--holdout run` holds out one run in so many, and needs at least as many runs.
RUNS_PER_HELD_OUT = 4


@dataclass(frozen=True)
class HoldoutSplit:
    """The rows to analyse and those held out; `name` is the entry of the report's figures."""

    analysed: Table
    held_out: Table | None = None
    name: str = ""
    description: str = ""


def split_holdout(table: Table, holdout: str | None, seed: int) -> HoldoutSplit:
    """Split a table by `run` (a quarter of the runs, at random) or by `COLUMN=VALUE`.

    Raises `InputError` for another text, for too few runs, or where no row remains to analyse.
    """
    if holdout is None:
        return HoldoutSplit(table)
    if holdout == "run":
        runs = np.unique(table["run"])
        if runs.size < RUNS_PER_HELD_OUT:
            raise InputError(f"--holdout run needs four runs or more; the table has {runs.size}")
        count = max(1, runs.size // RUNS_PER_HELD_OUT)
        chosen = np.random.default_rng(seed).permutation(runs)[:count]
        held_out = np.isin(table["run"], chosen)
        name, description = "held_out_runs", f"runs {', '.join(sorted(map(str, chosen)))}"
    else:
        key, equals, value = holdout.partition("=")
        if not equals:
            raise InputError(f"--holdout is {holdout!r}; needed is run, or COLUMN=VALUE")
        rows = _positions(table, table.where(key, value))
        held_out = np.isin(np.arange(len(table)), rows)
        name, description = "held_out_region", holdout
    if held_out.all():
        raise InputError(f"--holdout {holdout} holds out every row; no row remains to analyse")
    description += ", held out"
    return HoldoutSplit(table.rows(~held_out), table.rows(held_out), name, description)


def _positions(table: Table, rows: Table) -> NDArray[np.int64]:
    """Positions of the rows of a part in the whole table: by line, else by content."""
    if len(table.line):
        return np.flatnonzero(np.isin(table.line, rows.line))
    keys = [tuple(str(table[n][i]) for n in table.columns) for i in range(len(table))]
    own = {tuple(str(rows[n][i]) for n in rows.columns) for i in range(len(rows))}
    return np.asarray([i for i, key in enumerate(keys) if key in own], dtype=np.int64)
