"""Simulate a recipe into a folder of Parquet files that the workers write, resumably."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from datagen.engines.processes import process_map
from datagen.generate import (
    WRITER,
    Engine,
    Generated,
    Progress,
    check_failures,
    check_space,
)
from datagen.pieces import PIECE, Piece, data_schema, failed_rows, pieces, simulate_batch
from datagen.recipe import Recipe
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output, create_folder

#: Rows of a file: whole pieces.
PART = 16 * PIECE
#: First rows of a file that are simulated again before the file is kept, and how closely they must
#: agree: vector units round the last digit by place.
PROBE, AGREEMENT = 16, 1e-9


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


def is_folder(path: str | os.PathLike[str]) -> bool:
    """Whether an output path means a folder: it ends with a slash, or is one."""
    return str(path).endswith(("/", os.sep)) or Path(path).is_dir()


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

    Parameters
    ----------
    recipe, progress, engine
        As in `generate`. Workers on other machines must see the folder under the same path.
    path
        The folder; it is created, but not its parents.
    rows_per_file
        A multiple of `datagen.pieces.PIECE`.

    Raises
    ------
    InputError
        As in `generate`, and where the folder has Parquet files of other data.
    """
    folder = Path(path).absolute()
    parts = [Part(i, rows) for i, rows in enumerate(pieces(recipe, rows_per_file))]
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
