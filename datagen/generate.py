"""From a recipe to a Parquet file, in pieces."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from datagen.draws import SampledRows, of_runs, sample_rows
from datagen.recipe import VIBRATION, Recipe
from datagen.sensor_noise import reported, true_values
from datagen.wheel_leg_vibration import HIDDEN, normal_stiffness
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.physics.soils import Soil
from soilml.quantities import COLUMNS, QUANTITIES
from soilml.row_status import Status

#: Rows of a piece: one row group of the file.
PIECE = 16384


@dataclass(frozen=True)
class Generated:
    """How many rows a file got, and how many of them have no equilibrium."""

    rows: int
    failed: int


def generate(
    recipe: Recipe,
    path: str | os.PathLike[str],
    progress: Callable[[int], None] = lambda rows: None,
) -> Generated:
    """Write the recipe's rows to a Parquet file; the same recipe gives the same bytes.

    The file appears under its name when it is whole. Rows without equilibrium stay in it, with
    their reason in `status` and blank readings. Raises `InputError` where more than half are so.
    """
    schema = _schema(recipe)
    total = failed = 0
    settings = {"compression": "zstd", "write_page_checksum": True}
    with atomic_output(path) as part, pq.ParquetWriter(part, schema, **settings) as writer:
        for columns in pieces(recipe):
            bad = int(np.count_nonzero(columns["status"] != Status.OK.reason))
            total, failed = total + len(columns["status"]), failed + bad
            arrays = [_array(columns[name], schema.field(name).type) for name in schema.names]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            progress(total)
        if failed > total / 2:
            raise InputError(
                f"{failed} of {total} rows have no equilibrium: lower load_N in [operating], or "
                "raise kphi, or look at [gear]"
            )
    return Generated(total, failed)


def pieces(recipe: Recipe) -> Iterator[dict[str, np.ndarray]]:
    """The rows, as dictionaries of columns, a piece at a time."""
    for block, size in enumerate(sizes(recipe)):
        for first in range(0, size, PIECE):
            yield piece(recipe, block, first, min(first + PIECE, size))


def sizes(recipe: Recipe) -> list[int]:
    """Rows of each block: whole runs, but in the block of the shortest, which fills up."""
    filler = min(range(len(recipe.blocks)), key=lambda i: recipe.blocks[i].rows)
    found = [int(recipe.rows * b.share / b.rows) * b.rows for b in recipe.blocks]
    found[filler] = recipe.rows - sum(size for i, size in enumerate(found) if i != filler)
    return found


def piece(recipe: Recipe, block: int, first: int, last: int) -> dict[str, np.ndarray]:
    """Rows `first` to `last` (excluded) of a block."""
    rows = sample_rows(recipe, block, first, last)
    case = recipe.case.with_values(rows.soil)
    at = Operating(slip=rows.slip, load=rows.load, **rows.covariates)
    force = case.model(case.soil, at)
    truth = true_values(rows.slip, rows.load, force)
    felt = _felt(recipe, block, rows, case.soil, truth)
    readings = reported(recipe, block, np.arange(first, last), rows.run, truth)
    reasons = np.asarray([status.reason for status in Status])
    names = {path: QUANTITIES[path].column if path in QUANTITIES else path for path in rows.soil}
    return {
        "run": np.asarray([f"{recipe.blocks[block].label}{number}" for number in rows.run]),
        **readings,
        **{COVARIATES[field]: values for field, values in rows.covariates.items()},
        **{names[path]: values for path, values in rows.soil.items()},
        **felt,
        "status": reasons[force.status],
    }


def _felt(
    recipe: Recipe, block: int, rows: SampledRows, soil: Soil, truth: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Adds what a leg's hub feels to the truth; columns of what it depends on, (n,)."""
    leg = recipe.stick_slip
    if leg is None:
        return {}
    width = recipe.case.parameters()["gear.width"][1]
    hidden = leg.hidden(soil, width, of_runs(recipe, block, rows.run, 2, 4))
    truth[VIBRATION] = leg.vibration(soil, rows.slip, rows.load, hidden, recipe.load.lower)
    stiffness = np.broadcast_to(normal_stiffness(soil, width), rows.slip.shape)
    columns = {QUANTITIES["normal_stiffness"].column: stiffness}
    return columns | {f"stick-slip.{name}": values for name, values in hidden.items()}


def _schema(recipe: Recipe) -> pa.Schema:
    probe = piece(recipe, 0, 0, 1)
    own = {name: parameter.unit for name, (parameter, _) in recipe.case.parameters().items()}
    own |= {f"stick-slip.{name}": unit for name, unit in HIDDEN.items()}
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
