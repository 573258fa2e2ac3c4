"""Generation of synthetic data: processes and dask, by number of workers, and a billion rows.

python bench/generation.py [ROWS]; python bench/run.py generation
"""

from __future__ import annotations

import functools
import io
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from datagen.dask_cluster import dask_map
from datagen.generate import PART, WRITER
from datagen.recipe import Recipe, read_recipe
from datagen.simulation import PIECE, Piece, data_schema, pieces, simulate_batch
from soilml.processes import process_map, usable_cores

#: Rows that are simulated for each line, unless an argument says otherwise.
ROWS = 32 * PIECE
#: First pieces of a line, in which workers import their libraries, and which do not count.
WARM_UP = 4
BILLION = 1_000_000_000
ABOUT = (
    f"{ROWS:,} rows of the recipe `wheel`, simulated and written as Parquet, by each engine "
    "(docs/cluster.md). Rows per second are by wall time, without the start of the workers, and "
    "suffer where other programs run; *processor time* is that of the tasks."
)


@dataclass(frozen=True)
class Line:
    """Rows per second of all workers by wall time, of one by processor time; bytes of a row."""

    rate: float
    rate_of_worker: float
    size: float


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


def section(folder: Path) -> str:
    """The table, and the arithmetic to a billion rows."""
    return table(ROWS)


def table(rows: int) -> str:
    """Rows per second of each engine by number of workers; the arithmetic to a billion rows."""
    recipe = read_recipe("wheel").sized(rows=max(4 * rows, 4 * PIECE))
    items = [piece for piece in pieces(recipe) if len(piece) == PIECE][: max(rows // PIECE, 8)]
    task = functools.partial(seconds_of_piece, recipe, data_schema(recipe))
    counts = sorted({1, *(2**k for k in range(1, 8) if 2**k < usable_cores()), usable_cores()})
    lines = [
        "| engine | workers | rows / s | over one process | rows / s and worker, processor time "
        "| first rows after s |",
        "|---|" + "---:|" * 5,
    ]
    found: list[Line] = []
    for name, engine in (("processes", process_map), ("dask", dask_map)):
        for workers in counts:
            print(f"  {name}, {workers}", file=sys.stderr, flush=True)
            start, wall, results = measure(task, items, functools.partial(engine, workers=workers))
            processor = statistics.median(a + b for _, a, b in results)
            size = statistics.median(size for size, _, _ in results) / PIECE
            found.append(Line(len(results) * PIECE / wall, PIECE / processor, size))
            cells = f"{found[-1].rate:,.0f} | {found[-1].rate / found[0].rate:.2f}"
            cells += f" | {found[-1].rate_of_worker:,.0f} | {start:.1f}"
            lines.append(f"| {name} | {workers} | {cells} |")
    hours = BILLION / found[0].rate_of_worker / 3600
    size = found[0].size * BILLION / 1e9
    return "\n".join(lines) + (
        f"\n\nA billion rows: {hours:.1f} hours of one core, {60 * hours / 64:.0f} minutes of 64; "
        f"{found[0].size:.0f} bytes a row, {size:.0f} GB in about {BILLION // PART:,} files."
    )


def main() -> None:
    """Print the table for the number of rows that the command line names."""
    print(table(int(sys.argv[1]) if len(sys.argv) > 1 else ROWS))


if __name__ == "__main__":
    main()
