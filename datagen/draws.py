"""Low-discrepancy samples of soils and operating points."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from datagen.recipe import OPERATING_COLUMNS, Block, Recipe

Floats = NDArray[np.float64]

#: Points of a Sobol sequence of scipy: runs that a block can have.
MOST_RUNS = 2**30


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
    _skip(sequence, int(skip))
    with warnings.catch_warnings():  # pieces of a sequence need not be powers of two
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(sequence.random(int(count)))


def _skip(sequence: qmc.Sobol, count: int) -> None:
    """Do what `sequence.fast_forward(count)` does, in constant time instead of linear.

    Point n of the sequence is the first one with the direction numbers of the bits of the Gray code
    of n added without carry (Antonov and Saleev 1979, eq. 4).
    """
    if not count:
        return
    if not (hasattr(sequence, "_sv") and hasattr(sequence, "_quasi")):
        sequence.fast_forward(count)
        return
    last = count - 1
    for bit in range(last.bit_length()):
        if (last ^ last >> 1) >> bit & 1:
            sequence._quasi ^= sequence._sv[:, bit]
    sequence.num_generated += count
