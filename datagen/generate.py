"""Simulate a recipe into a Parquet file, piece by piece."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from datagen.draws import SampledRows, run_fractions, sample_rows
from datagen.gear_sensors import GEAR_SENSORS
from datagen.recipe import OPERATING_COLUMNS, Recipe
from datagen.sensor_noise import noisy_readings, true_values
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import COLUMNS, QUANTITIES
from soilml.row_status import Status

#: Rows of a piece: one row group of the file.
PIECE = 16384
#: Number of the first random stream of gear sensors; lower ones are those of `datagen.draws`.
FIRST_STREAM = 4


@dataclass(frozen=True)
class Generated:
    """Number of rows in a file, and of those without equilibrium."""

    rows: int
    failed: int


def generate(
    recipe: Recipe,
    path: str | os.PathLike[str],
    progress: Callable[[int], None] = lambda rows: None,
) -> Generated:
    """Simulate a recipe and write its rows to a Parquet file, atomically.

    The same recipe gives the same bytes on the same machine.

    Parameters
    ----------
    recipe
        Gear, soils, operating ranges, noise, number of rows and seed; see `read_recipe`.
    path
        The Parquet file. Columns: run, the readings, covariates, the true parameters that vary,
        status; the unit of each is in its metadata, the recipe in that of the file.
    progress
        Called with the number of rows written so far.

    Returns
    -------
    Generated
        Number of rows, and of rows without equilibrium. The latter are in the file with blank
        readings and the reason in `status`.

    Raises
    ------
    InputError
        Where more than half of the rows have no equilibrium, or the file cannot be written.

    Examples
    --------
    >>> from datagen.recipe import read_recipe
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     generate(read_recipe("wheel").sized(rows=64, seed=1), f"{folder}/data.parquet")
    Generated(rows=64, failed=0)
    """
    schema = _schema(recipe)
    total = failed = 0
    settings = {"compression": "zstd", "write_page_checksum": True}
    with atomic_output(path) as part, pq.ParquetWriter(part, schema, **settings) as writer:
        for columns in simulate_pieces(recipe):
            bad = int(np.count_nonzero(columns["status"] != Status.OK.reason))
            total, failed = total + len(columns["status"]), failed + bad
            arrays = [_array(columns[name], schema.field(name).type) for name in schema.names]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            progress(total)
        if failed > total / 2:
            raise InputError(
                f"{failed} of {total} rows have no equilibrium: lower load_N in [operating], or "
                "raise kphi, or check [gear]"
            )
    return Generated(total, failed)


def simulate_pieces(recipe: Recipe) -> Iterator[dict[str, np.ndarray]]:
    """The rows as dictionaries of columns, one piece after the other."""
    for block, size in enumerate(block_sizes(recipe)):
        for first in range(0, size, PIECE):
            yield simulate_rows(recipe, block, first, min(first + PIECE, size))


def block_sizes(recipe: Recipe) -> list[int]:
    """Rows of each block: complete runs, except that the block of the shortest gets the rest."""
    shortest = min(range(len(recipe.blocks)), key=lambda i: recipe.blocks[i].rows)
    sizes = [int(recipe.rows * b.share / b.rows) * b.rows for b in recipe.blocks]
    sizes[shortest] = recipe.rows - sum(size for i, size in enumerate(sizes) if i != shortest)
    return sizes


def simulate_rows(recipe: Recipe, block: int, first: int, last: int) -> dict[str, np.ndarray]:
    """Columns of the rows `first` to `last` (excluded) of a block, each (last - first,)."""
    rows = sample_rows(recipe, block, first, last)
    case = recipe.case.with_values(rows.soil)
    at = Operating(slip=rows.slip, load=rows.load, **rows.covariates)
    force = case.model(case.soil, at)
    truth = true_values(rows.slip, rows.load, force)
    sensor_columns = _add_gear_sensors(recipe, case, block, rows, truth)
    readings = noisy_readings(recipe, block, np.arange(first, last), rows.run, truth)
    reasons = np.asarray([status.reason for status in Status])
    names = {path: QUANTITIES[path].column if path in QUANTITIES else path for path in rows.soil}
    return {
        "run": np.asarray([f"{recipe.blocks[block].label}{number}" for number in rows.run]),
        **readings,
        **{COVARIATES[field]: values for field, values in rows.covariates.items()},
        **{names[path]: values for path, values in rows.soil.items()},
        **sensor_columns,
        "status": reasons[force.status],
    }


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


def _schema(recipe: Recipe) -> pa.Schema:
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


def _array(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    if kind == pa.string():
        return pa.array(values.tolist(), kind)
    return pa.array(values, kind, from_pandas=True)
