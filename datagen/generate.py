"""Simulate a recipe into a Parquet file, on all cores."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from datagen.recipe import Recipe
from datagen.simulation import PIECE, Piece, data_schema, failed_rows, pieces, simulate_batch
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output
from soilml.processes import process_map

#: Settings of the Parquet files. A dictionary of numbers that do not repeat only takes time.
WRITER: dict[str, Any] = {
    "compression": "zstd",
    "write_page_checksum": True,
    "use_dictionary": ["run", "status"],
}
SAMPLE = 4096  # Rows that are simulated to estimate the size of a file

Progress = Callable[[int], None]
#: A function of a function and items, which yields the results in the order of the items.
Engine = Callable[[Callable[[Any], Any], Sequence[Any]], AbstractContextManager[Any]]


def generate(
    recipe: Recipe,
    path: str | os.PathLike[str],
    progress: Progress = lambda rows: None,
    engine: Engine = process_map,
) -> int:
    """Simulate a recipe and write its rows to a Parquet file, atomically.

    The same recipe gives the same bytes on the same machine, whatever the engine and its workers.

    recipe: Gear, soils, operating ranges, noise, number of rows and seed; see `read_recipe`.
    path: The Parquet file. Columns: run, the readings, covariates, the true parameters that vary,
        status; the unit of each is in its metadata, the recipe in that of the file.
    progress: Called with the number of rows written so far.
    engine: Where rows are simulated: `process_map`, on all cores, by default.

    Returns: Number of rows without equilibrium, which are in the file with blank readings and the
    reason in `status`.

    Raises `InputError` where more than half of the rows have no equilibrium, the disk is too small,
    or the file cannot be written.

    Examples
    --------
    >>> from datagen.recipe import read_recipe
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     generate(read_recipe("wheel").sized(rows=64, seed=1), f"{folder}/data.parquet")
    0
    """
    schema, items = data_schema(recipe), pieces(recipe)
    _check_space(recipe, path)
    total = failed = 0
    with (
        engine(partial(simulate_batch, recipe, schema), items) as batches,
        atomic_output(path) as part,
        pq.ParquetWriter(part, schema, **WRITER) as writer,
    ):
        for batch in batches:
            total, failed = total + len(batch), failed + failed_rows(batch)
            writer.write_table(pa.Table.from_batches([batch]))
            progress(total)
        if failed > total / 2:
            raise InputError(
                f"{failed} of {total} rows have no equilibrium: lower load_N in [operating], or "
                "raise kphi, or check [gear]"
            )
    return failed


def _check_space(recipe: Recipe, path: str | os.PathLike[str]) -> None:
    """Raise `InputError` where the disk of `path` is too small, by the size of a few rows."""
    folder = Path(path).absolute().parent
    if recipe.rows <= PIECE or not folder.is_dir():
        return
    schema = data_schema(recipe)
    sample = io.BytesIO()
    with pq.ParquetWriter(sample, schema, **WRITER) as writer:
        batch = simulate_batch(recipe, schema, Piece(0, 0, min(SAMPLE, len(pieces(recipe)[0]))))
        writer.write_table(pa.Table.from_batches([batch]))
    needed = sample.tell() / len(batch) * recipe.rows
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"{recipe.rows} rows take about {needed / 1e9:.3g} GB; {folder} has {free / 1e9:.3g} GB"
            " free: ask for fewer rows, or write to another disk"
        )
