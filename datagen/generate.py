"""Simulate a recipe into a Parquet file, or a folder of them, on all cores or on a cluster."""

from __future__ import annotations

import io
import json
import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from datagen.recipe import Recipe
from datagen.simulation import PIECE, Piece, data_schema, failed_rows, pieces, simulate_batch
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output, create_folder
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
PART = 16 * PIECE  # Rows of a file: whole pieces
#: First rows of a file that are simulated again before the file is kept, and how closely they must
#: agree: vector units round the last digit by place.
PROBE, AGREEMENT = 16, 1e-9


@dataclass(frozen=True)
class Generated:
    """Number of rows written or kept, of those without equilibrium, and of those kept."""

    rows: int
    failed: int
    kept: int = 0


def generate(
    recipe: Recipe,
    path: str | os.PathLike[str],
    progress: Progress = lambda rows: None,
    engine: Engine = process_map,
) -> Generated:
    """Simulate a recipe and write its rows to a Parquet file, atomically.

    The same recipe gives the same bytes on the same machine, whatever the engine and its workers.

    recipe: Gear, soils, operating ranges, noise, number of rows and seed; see `read_recipe`.
    path: The Parquet file. Columns: run, the readings, covariates, the true parameters that vary,
        status; the unit of each is in its metadata, the recipe in that of the file.
    progress: Called with the number of rows written so far.
    engine: Where rows are simulated: `process_map`, on all cores, by default.

    Returns: Number of rows, and of rows without equilibrium. The latter are in the file with blank
    readings and the reason in `status`.

    Raises `InputError` where more than half of the rows have no equilibrium, the disk is too small,
    or the file cannot be written.

    Examples
    --------
    >>> from datagen.recipe import read_recipe
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     generate(read_recipe("wheel").sized(rows=64, seed=1), f"{folder}/data.parquet")
    Generated(rows=64, failed=0, kept=0)
    """
    schema, items = data_schema(recipe), pieces(recipe)
    check_space(recipe, path)
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
        check_failures(failed, total)
    return Generated(total, failed)


def check_failures(failed: int, total: int) -> None:
    """Raise `InputError` where more than half of the rows have no equilibrium."""
    if failed > total / 2:
        raise InputError(
            f"{failed} of {total} rows have no equilibrium: lower load_N in [operating], or "
            "raise kphi, or check [gear]"
        )


def check_space(recipe: Recipe, path: str | os.PathLike[str], present: int = 0) -> None:
    """Raise `InputError` where the disk of `path` is too small for the rows of a recipe.

    Their size is estimated from a few rows. `present` bytes of it are on the disk already.
    """
    target = Path(path).absolute()
    folder = target if target.is_dir() else target.parent
    if recipe.rows <= PIECE or not folder.is_dir():
        return
    schema = data_schema(recipe)
    sample = io.BytesIO()
    with pq.ParquetWriter(sample, schema, **WRITER) as writer:
        batch = simulate_batch(recipe, schema, Piece(0, 0, min(SAMPLE, len(pieces(recipe)[0]))))
        writer.write_table(pa.Table.from_batches([batch]))
    needed = sample.tell() / len(batch) * recipe.rows - present
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"{recipe.rows} rows take about {needed / 1e9:.3g} GB; {folder} has {free / 1e9:.3g} GB"
            " free: ask for fewer rows, or write to another disk"
        )


@dataclass(frozen=True)
class Part:
    """A file of the folder: its number, and its rows."""

    number: int
    rows: Piece

    @property
    def name(self) -> str:
        """Name of the file."""
        return f"part-{self.number:06d}.parquet"

    def schema(self, recipe: Recipe) -> pa.Schema:
        """Columns and metadata of the file; the latter say which rows it has."""
        schema = data_schema(recipe)
        own = json.dumps([self.number, self.rows.block, self.rows.first, self.rows.last])
        return schema.with_metadata(schema.metadata | {"soilml_part": own})

    def pieces(self) -> list[Piece]:
        """The rows, in the pieces in which a single file has them."""
        block, end = self.rows.block, self.rows.last
        return [
            Piece(block, first, min(first + PIECE, end))
            for first in range(self.rows.first, end, PIECE)
        ]


@dataclass(frozen=True)
class PartResult:
    """What a worker reports of a file; `kept` where it was there already, whole and right."""

    rows: int
    failed: int
    kept: bool


def generate_folder(
    recipe: Recipe,
    path: str | os.PathLike[str],
    progress: Progress = lambda rows: None,
    engine: Engine = process_map,
    rows_per_file: int = PART,
) -> Generated:
    """Simulate a recipe into files part-000000.parquet, ... of a folder, written by the workers.

    The files have the rows of the one file of `generate`, in order. Each is written atomically.
    Files of an interrupted call stay, and a further call completes them: a file is kept if it has
    the recipe, seed, versions and rows that it should have, its checksums hold, and its first rows
    are those of a new simulation; otherwise it is written again.

    recipe, progress, engine: As in `generate`. Workers on other machines must see the folder under
        the same path.
    path: The folder; it is created, but not its parents.
    rows_per_file: A multiple of `datagen.simulation.PIECE`.

    Raises `InputError` as in `generate`, and where the folder has Parquet files of other data.
    """
    folder = Path(path).absolute()
    parts = [Part(i, rows) for i, rows in enumerate(pieces(recipe, size=rows_per_file))]
    present = _check_folder(recipe, folder, parts)
    if not folder.parent.is_dir():
        raise InputError(f"{path}: the folder {folder.parent} does not exist; create it first")
    check_space(recipe, folder, present)
    _check_sample(recipe, parts[0])
    total = failed = kept = 0
    with create_folder(folder):
        try:
            with engine(partial(complete_part, recipe, folder), parts) as results:
                for result in results:
                    total, failed = total + result.rows, failed + result.failed
                    kept += result.rows * result.kept
                    progress(total)
        finally:
            for left in folder.glob(".part-*.*"):  # of workers that were killed
                if left.suffix in (".part", ".journal"):
                    left.unlink(missing_ok=True)
    check_failures(failed, total)
    return Generated(total, failed, kept)


def complete_part(recipe: Recipe, folder: Path, part: Part) -> PartResult:
    """Write a file of the folder, unless it is there and right."""
    schema = part.schema(recipe)
    found = _read_right(recipe, folder / part.name, part)
    if found is not None:
        failed = sum(failed_rows(batch) for batch in found.to_batches())
        return PartResult(len(found), failed, True)
    failed = 0
    with (
        atomic_output(folder / part.name) as file,
        pq.ParquetWriter(file, schema, **WRITER) as writer,
    ):
        for piece in part.pieces():
            batch = simulate_batch(recipe, schema, piece)
            failed += failed_rows(batch)
            writer.write_table(pa.Table.from_batches([batch]))
    return PartResult(len(part.rows), failed, False)


def _read_right(recipe: Recipe, file: Path, part: Part) -> pa.Table | None:
    """The content of a file that is whole and what it should be; None where it is not."""
    try:
        with pa.OSFile(os.fsencode(file)) as opened:  # no object of Python: see soilml.io.parquet
            found = pq.ParquetFile(opened, page_checksum_verification=True).read()
    except (OSError, pa.ArrowException):
        return None
    schema = part.schema(recipe)
    if not found.schema.equals(schema, check_metadata=True) or len(found) != len(part.rows):
        return None
    first = part.rows.first
    probe = Piece(part.rows.block, first, min(first + PROBE, part.rows.last))
    again = simulate_batch(recipe, schema, probe)
    for name in schema.names:
        old, new = found.column(name).slice(0, len(again)), again.column(name)
        if name in ("run", "status"):
            same = old.to_pylist() == new.to_pylist()
        else:
            same = np.allclose(old.to_numpy(), new.to_numpy(False), AGREEMENT, 0.0, equal_nan=True)
        if not same:
            return None
    return found


def _check_folder(recipe: Recipe, folder: Path, parts: Sequence[Part]) -> int:
    """Bytes of the files that are there; raises `InputError` where there are other data."""
    expected = {part.name: part for part in parts}
    size = 0
    for file in sorted(folder.glob("*.parquet")):
        part = expected.get(file.name)
        try:
            found = pq.read_schema(file)
        except (OSError, pa.ArrowException):
            found = None  # incomplete or damaged: written again if it is one of ours
        if part is None or (
            found is not None and not found.equals(part.schema(recipe), check_metadata=True)
        ):
            raise InputError(
                f"{file} is of another recipe, seed, number of rows or version: give another "
                "folder, or remove it"
            )
        size += file.stat().st_size
    return size


def _check_sample(recipe: Recipe, part: Part) -> None:
    """Raise `InputError` before anything is written where most rows have no equilibrium."""
    first = part.pieces()[0]
    piece = Piece(first.block, first.first, min(first.first + 1024, first.last))
    batch = simulate_batch(recipe, data_schema(recipe), piece)
    check_failures(failed_rows(batch), len(batch))
