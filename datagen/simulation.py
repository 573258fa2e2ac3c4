"""Rows of a recipe: low-discrepancy soils and operating points, forces, readings of sensors."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import compute
from scipy.stats import qmc

from datagen.gear_sensors import RUN_DRAWS, UNITS, VIBRATION_COLUMN
from datagen.recipe import OPERATING_COLUMNS, SENSOR_COLUMNS, Block, Recipe
from datagen.worlds import normal_by_index, process_functions, smooth_error
from soilml.arrays import Floats
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import InputError
from soilml.fitting.predictions import forces_of_one_gear
from soilml.numerics.smooth_process import SmoothFunctions
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import CHANNELS, COLUMNS, QUANTITIES, column
from soilml.row_status import Status

MOST_RUNS = 2**30  # Points of a Sobol sequence of scipy: runs that a block can have
PIECE = 16384  # Rows of a piece: one row group of a file
SENSOR_STREAM = 4  # Random stream of the vibration; lower ones are those of `sample_rows`
REASONS = np.asarray([status.reason for status in Status])  # Text of the column `status` by status


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
    errors = [model_error(recipe, block, at, rows.run)]
    if recipe.worlds is None:
        force = forces_of_one_gear(case, at)
    else:
        seed = recipe.seed, block
        force = recipe.worlds.forces(case, at, seed, rows.run)
        errors.append(recipe.worlds.errors(recipe.driven, at, seed, rows.run))
    truth = {"slip": rows.slip, "load_N": rows.load}
    truth |= {column(name): getattr(force, name) for name in CHANNELS}
    for name, error in (pair for own in errors for pair in own.items()):
        truth[name] = truth[name] + error
    sensor_columns: dict[str, Floats] = {}
    if recipe.stick_slip is not None:
        used = len(recipe.case.prior) + len(OPERATING_COLUMNS) + len(recipe.covariates)
        u = run_fractions(recipe, block, rows.run, RUN_DRAWS, SENSOR_STREAM, used)
        truth[VIBRATION_COLUMN], sensor_columns = recipe.stick_slip.simulate(
            case, rows.slip, rows.load, recipe.load.lower, u
        )
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


def model_error(
    recipe: Recipe, block: int, at: Operating, run: NDArray[np.int64]
) -> dict[str, Floats]:
    """The error about its mean (n,) of each column with a [remainder] or from an emulator.

    Its variance is that of a model whose soil is fitted anew, as the soil of a run is one of the
    prior; see `smooth_error`.
    """
    parts: dict[str, list[SmoothFunctions]] = {}
    if (remainder := recipe.case.remainder) is not None:
        for name in filter(remainder.of, CHANNELS):
            parts[name] = [remainder.error_functions(name, *recipe.driven)]
    if (simulator := recipe.case.simulator) is not None:
        for name in CHANNELS:
            if std := simulator.error.get(column(name)):
                functions = process_functions(Discrepancy(constant=std), recipe.driven)
                parts.setdefault(name, []).append(functions)
    errors = {}
    for name, own in parts.items():
        seed = recipe.seed, block, SENSOR_COLUMNS.index(column(name)), 3
        errors[column(name)] = smooth_error(SmoothFunctions.joined(own), seed, at, run)
    return errors


def data_schema(recipe: Recipe) -> pa.Schema:
    """Columns of the data with their units; recipe, seed and versions as metadata."""
    probe = simulate_rows(recipe, 0, 0, 1)
    own = {name: parameter.unit for name, (parameter, _) in recipe.case.parameters().items()}
    units = {n: COLUMNS[n].unit if n in COLUMNS else (own | UNITS)[n] for n in probe}
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


@dataclass(frozen=True)
class SampledRows:
    """Rows (n,): the number of the run, parameters by path, slip, load (N) and covariates."""

    run: NDArray[np.int64]
    soil: dict[str, Floats]
    slip: Floats
    load: Floats
    covariates: dict[str, Floats]


def sample_rows(recipe: Recipe, block: int, first: int, last: int) -> SampledRows:
    """Rows `first` to `last` (excluded) of a block; they do not depend on the pieces drawn.

    Runs of one row take soil and operating point from one scrambled Sobol sequence. Longer runs
    take soils and operating points from two, and columns that are steady within a run from the
    sequence of the soils.
    """
    shape: Block = recipe.blocks[block]
    priors = list(recipe.case.prior.items())
    row = np.arange(first, last)
    run = row // shape.rows
    if shape.rows == 1:
        both = _sobol(len(priors) + 2, (recipe.seed, block, 0), first, last - first)
        soil, operating = both[:, :-2], both[:, -2:]
    else:
        dimensions = len(priors) + len(shape.steady)
        runs = _sobol(dimensions, (recipe.seed, block, 1), run[0], run[-1] - run[0] + 1)
        soil = runs[run - run[0]]
        operating = _sobol(len(OPERATING_COLUMNS), (recipe.seed, block, 2), first, last - first)
        for i, name in enumerate(shape.steady, len(priors)):
            operating[:, OPERATING_COLUMNS.index(name)] = soil[:, i]
    position = row % shape.rows
    for name, count in shape.levels:
        operating[:, OPERATING_COLUMNS.index(name)] = position % count / (count - 1)
        position = position // count
    return SampledRows(
        run=run,
        soil={path: prior.at(soil[:, i]) for i, (path, prior) in enumerate(priors)},
        slip=recipe.slip.at(operating[:, 0]),
        load=recipe.load.at(operating[:, 1]),
        covariates=_covariates(recipe, block, run),
    )


def _covariates(recipe: Recipe, block: int, run: NDArray[np.int64]) -> dict[str, Floats]:
    """Speed, pass and slip angle where the recipe varies them: one value for each run."""
    if not recipe.covariates:
        return {}
    used = len(recipe.case.prior) + len(OPERATING_COLUMNS)
    u = run_fractions(recipe, block, run, len(recipe.covariates), 3, used)
    values = {
        field: prior.at(u[:, i]) for i, (field, prior) in enumerate(recipe.covariates.items())
    }
    if "pass_number" in values:
        values["pass_number"] = np.round(values["pass_number"])
    return values


def run_fractions(
    recipe: Recipe, block: int, run: NDArray[np.int64], count: int, stream: int, used: int
) -> Floats:
    """Fractions (n, count), one value for each run, independent of other random numbers of a run.

    The same dimension of two scrambled sequences is correlated, so the first `used` dimensions,
    which other quantities take, are skipped.
    """
    runs = int(run[-1] - run[0] + 1)
    u = _sobol(used + count, (recipe.seed, block, stream), int(run[0]), runs)
    return u[run - run[0], used:]


def _sobol(dimensions: int, seed: tuple[int, ...], skip: int, count: int) -> Floats:
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if skip:
        sequence.fast_forward(int(skip))
    with warnings.catch_warnings():  # pieces of a sequence need not be powers of two
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(sequence.random(int(count)))


def noisy_readings(
    recipe: Recipe,
    block: int,
    row: NDArray[np.int64],
    run: NDArray[np.int64],
    truth: dict[str, Floats],
) -> dict[str, Floats]:
    """Readings (n,) of the true values: noise for every row, a bias for every run.

    The random numbers of a row depend on the seed, the block and the row only.
    """
    readings = {}
    for position, name in enumerate(SENSOR_COLUMNS):
        if name not in truth:
            continue
        true = truth[name]
        reading = true.copy()
        if name in recipe.case.noise:
            noise = normal_by_index((recipe.seed, block, position, 1), row)
            reading += recipe.case.noise[name].std(true) * noise
        if name in recipe.bias:
            reading += recipe.bias[name].std(true) * normal_by_index(
                (recipe.seed, block, position, 2), run
            )
        if name == "slip":
            reading = np.clip(reading, -0.999, 0.999)
        if name == "load_N":
            reading = np.maximum(reading, 1e-3 * true)
        readings[name] = reading
    return readings
