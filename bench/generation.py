"""Generation of synthetic data: processes and dask, by number of workers, and a billion rows.

python bench/generation.py [ROWS]
"""

from __future__ import annotations

import functools
import io
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from datagen.engines.dask_cluster import dask_map
from datagen.engines.processes import process_map
from datagen.engines.worker_setup import usable_cores
from datagen.generate import WRITER
from datagen.partitions import PART
from datagen.pieces import PIECE, Piece, data_schema, pieces, simulate_batch
from datagen.recipe import Recipe, read_recipe

#: Rows that are simulated for each line, unless an argument says otherwise.
ROWS = 32 * PIECE
#: First pieces of a line, in which workers import their libraries, and which do not count.
WARM_UP = 4
BILLION = 1_000_000_000


def seconds_of_piece(recipe: Recipe, schema: pa.Schema, piece: Piece) -> tuple[int, float, float]:
    """Bytes of a piece as Parquet, and processor time for simulating and for writing it."""
    started = time.process_time()
    batch = simulate_batch(recipe, schema, piece)
    simulated = time.process_time()
    file = io.BytesIO()
    with pq.ParquetWriter(file, schema, **WRITER) as writer:
        writer.write_table(pa.Table.from_batches([batch]))
    return file.tell(), simulated - started, time.process_time() - simulated


def measure(
    task: Callable[[Piece], Any], items: Sequence[Piece], engine: Callable[..., Any]
) -> tuple[float, float, list[tuple[int, float, float]]]:
    """Seconds until workers are there, seconds for all pieces but the first, and their results."""
    started = time.perf_counter()
    with engine(task, items) as results:
        found, warm = [], started
        for result in results:
            found.append(result)
            if len(found) == WARM_UP:
                warm = time.perf_counter()
        return warm - started, time.perf_counter() - warm, found[WARM_UP:]


def main() -> None:
    """Print the table and the arithmetic."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else ROWS
    recipe = read_recipe("wheel").sized(rows=max(4 * rows, 4 * PIECE))
    items = [piece for piece in pieces(recipe) if len(piece) == PIECE][: max(rows // PIECE, 8)]
    task = functools.partial(seconds_of_piece, recipe, data_schema(recipe))
    counts = sorted({1, *(2**k for k in range(1, 8) if 2**k < usable_cores()), usable_cores()})
    print("| engine | workers | rows/s | rows/s and worker, processor time | first rows after s |")
    print("|---|---|---|---|---|")
    rate = size = 0.0
    for name, engine in (("processes", process_map), ("dask", dask_map)):
        for workers in counts:
            start, wall, found = measure(task, items, functools.partial(engine, workers=workers))
            processor = statistics.median(a + b for _, a, b in found)
            done = len(found) * PIECE
            cells = f"{done / wall:.0f} | {PIECE / processor:.0f} | {start:.1f}"
            print(f"| {name} | {workers} | {cells} |", flush=True)
            if name == "processes" and workers == 1:
                rate, size = PIECE / processor, statistics.median(b for b, _, _ in found) / PIECE
    hours = BILLION / rate / 3600
    print(
        f"\nA billion rows: {hours:.1f} hours of one core, {60 * hours / 64:.0f} minutes of 64; "
        f"{size:.0f} bytes a row, {size * BILLION / 1e9:.0f} GB in about {BILLION // PART} files"
    )


if __name__ == "__main__":
    main()
