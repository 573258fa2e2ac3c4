"""Pieces of a data set: which rows there are, and the simulation of any of them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from pyarrow import compute

from datagen.draws import MOST_RUNS, SampledRows, run_fractions, sample_rows
from datagen.gear_sensors import GEAR_SENSORS
from datagen.recipe import OPERATING_COLUMNS, Recipe
from datagen.sensor_noise import noisy_readings, true_values
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import COLUMNS, QUANTITIES
from soilml.row_status import Status

#: Rows of a piece: one row group of a file.
PIECE = 16384
#: Number of the first random stream of gear sensors; lower ones are those of `datagen.draws`.
FIRST_STREAM = 4
#: Text of the column `status` by status.
REASONS = np.asarray([status.reason for status in Status])


@dataclass(frozen=True)
class Piece:
    """The rows `first` to `last` (excluded) of a block of the recipe."""

    block: int
    first: int
    last: int

    def __len__(self) -> int:
        return self.last - self.first


def pieces(recipe: Recipe, size: int = PIECE) -> list[Piece]:
    """All rows in pieces of at most `size` rows.

    Raises `InputError` where a block has more runs than its low-discrepancy sequence has points.
    """
    found = []
    for block, rows in enumerate(block_sizes(recipe)):
        if rows > MOST_RUNS:
            raise InputError(
                f"{rows} rows are asked for in one [[runs]]; at most {MOST_RUNS} can be drawn with "
                "one seed: generate several data sets with different seeds"
            )
        found += [Piece(block, k, min(k + size, rows)) for k in range(0, rows, size)]
    return found


def simulate_pieces(recipe: Recipe) -> Iterator[dict[str, np.ndarray]]:
    """The rows as dictionaries of columns, one piece after the other."""
    for piece in pieces(recipe):
        yield simulate_rows(recipe, piece.block, piece.first, piece.last)


def block_sizes(recipe: Recipe) -> list[int]:
    """Rows of each block: complete runs, except that the block of the shortest gets the rest."""
    shortest = min(range(len(recipe.blocks)), key=lambda i: recipe.blocks[i].rows)
    sizes = [int(recipe.rows * b.share / b.rows) * b.rows for b in recipe.blocks]
    sizes[shortest] = recipe.rows - sum(size for i, size in enumerate(sizes) if i != shortest)
    return sizes


def simulate_rows(recipe: Recipe, block: int, first: int, last: int) -> dict[str, np.ndarray]:
    """Columns of the rows `first` to `last` (excluded) of a block, each (last - first,)."""
    run, columns, status = _simulate(recipe, Piece(block, first, last))
    label = recipe.blocks[block].label
    names = np.asarray([f"{label}{number}" for number in run])
    return {"run": names, **columns, "status": REASONS[status]}


def simulate_batch(recipe: Recipe, schema: pa.Schema, piece: Piece) -> pa.RecordBatch:
    """The rows of a piece as Arrow columns of a schema of `data_schema`."""
    run, columns, status = _simulate(recipe, piece)
    label = pa.scalar(recipe.blocks[piece.block].label)
    text = {
        "run": compute.binary_join_element_wise(label, pa.array(run).cast(pa.string()), ""),
        "status": pa.array(REASONS.tolist(), pa.string()).take(pa.array(status)),
    }
    arrays = [
        text[name] if name in text else pa.array(columns[name], pa.float64(), from_pandas=True)
        for name in schema.names
    ]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)


def failed_rows(batch: pa.RecordBatch) -> int:
    """Number of rows without equilibrium."""
    good = compute.equal(batch.column("status"), Status.OK.reason)
    return len(batch) - int(compute.sum(good).as_py() or 0)


def _simulate(recipe: Recipe, piece: Piece) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Number of the run (n,), columns (n,) of numbers by name, and status (n,)."""
    block = piece.block
    rows = sample_rows(recipe, block, piece.first, piece.last)
    case = recipe.case.with_values(rows.soil)
    at = Operating(slip=rows.slip, load=rows.load, **rows.covariates)
    force = case.model(case.soil, at)
    truth = true_values(rows.slip, rows.load, force)
    sensor_columns = _add_gear_sensors(recipe, case, block, rows, truth)
    row = np.arange(piece.first, piece.last)
    readings = noisy_readings(recipe, block, row, rows.run, truth)
    names = {path: QUANTITIES[path].column if path in QUANTITIES else path for path in rows.soil}
    columns = {
        **readings,
        **{COVARIATES[field]: values for field, values in rows.covariates.items()},
        **{names[path]: values for path, values in rows.soil.items()},
        **sensor_columns,
    }
    return rows.run, columns, force.status


def _add_gear_sensors(
    recipe: Recipe, case: Case, block: int, rows: SampledRows, truth: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Add the readings of the recipe's gear sensors to `truth`; returns their further columns."""
    columns: dict[str, np.ndarray] = {}
    used = len(recipe.case.prior) + len(OPERATING_COLUMNS) + len(recipe.covariates)
    for table, sensor in recipe.gear_sensors.items():
        stream = FIRST_STREAM + list(GEAR_SENSORS).index(table)
        u = run_fractions(recipe, block, rows.run, sensor.run_draws, stream, used)
        used += sensor.run_draws
        reading, own = sensor.simulate(case, rows.slip, rows.load, recipe.load.lower, u)
        truth[sensor.sensor] = reading
        columns |= own
    return columns


def data_schema(recipe: Recipe) -> pa.Schema:
    """Columns of the data with their units; recipe, seed and versions as metadata."""
    probe = simulate_rows(recipe, 0, 0, 1)
    own = {name: parameter.unit for name, (parameter, _) in recipe.case.parameters().items()}
    for sensor in recipe.gear_sensors.values():
        own |= sensor.units
    units = {name: COLUMNS[name].unit if name in COLUMNS else own[name] for name in probe}
    fields = [
        pa.field(
            name,
            pa.string() if values.dtype.kind == "U" else pa.float64(),
            metadata={"unit": units[name]},
        )
        for name, values in probe.items()
    ]
    from soilml import __version__

    versions = {"soilml": __version__, "numpy": np.__version__, "pyarrow": pa.__version__}
    metadata = {
        "soilml_recipe": recipe.text,
        "soilml_recipe_sha256": recipe.sha256,
        "soilml_seed": str(recipe.seed),
        "soilml_rows": str(recipe.rows),
        "soilml_units": json.dumps(units),
        "soilml_versions": json.dumps(versions),
    }
    return pa.schema(fields, metadata=metadata)
