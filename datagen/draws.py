"""Low-discrepancy draws of soils and operating points."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from datagen.recipe import DRIVEN, Block, Recipe

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SampledRows:
    """Rows (n,): the number of the run, and each parameter's value by path."""

    run: NDArray[np.int64]
    soil: dict[str, Floats]
    slip: Floats
    load: Floats
    covariates: dict[str, Floats]


def sample_rows(recipe: Recipe, block: int, first: int, last: int) -> SampledRows:
    """Rows `first` to `last` (excluded) of a block; the same whatever pieces it is drawn in.

    Runs of one row vary soil and operating point in one scrambled Sobol sequence; longer runs draw
    soils and operating points from two, and what is steady within a run with the soils.
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
        operating = _sobol(len(DRIVEN), (recipe.seed, block, 2), first, last - first)
        for i, name in enumerate(shape.steady, len(priors)):
            operating[:, DRIVEN.index(name)] = soil[:, i]
    place = row % shape.rows
    for name, count in shape.levels:
        operating[:, DRIVEN.index(name)] = place % count / (count - 1)
        place = place // count
    return SampledRows(
        run=run,
        soil={path: prior.at(soil[:, i]) for i, (path, prior) in enumerate(priors)},
        slip=recipe.slip.at(operating[:, 0]),
        load=recipe.load.at(operating[:, 1]),
        covariates=_covariates(recipe, block, run),
    )


def _covariates(recipe: Recipe, block: int, run: NDArray[np.int64]) -> dict[str, Floats]:
    """Speed, pass and slip angle where the recipe varies them: one draw for each run."""
    if not recipe.covariates:
        return {}
    u = of_runs(recipe, block, run, len(recipe.covariates), 3)
    found = {field: prior.at(u[:, i]) for i, (field, prior) in enumerate(recipe.covariates.items())}
    if "pass_number" in found:
        found["pass_number"] = np.round(found["pass_number"])
    return found


def of_runs(recipe: Recipe, block: int, run: NDArray[np.int64], count: int, stream: int) -> Floats:
    """Fractions (n, count), one draw for each run, that do not follow the soil's.

    The same dimension of two scrambled sequences runs together: these take dimensions of their own.
    """
    taken = len(recipe.case.prior) + len(DRIVEN) + (stream - 3) * len(recipe.covariates)
    runs = int(run[-1] - run[0] + 1)
    u = _sobol(taken + count, (recipe.seed, block, stream), int(run[0]), runs)
    return u[run - run[0], taken:]


def _sobol(dimensions: int, seed: tuple[int, ...], skip: int, count: int) -> Floats:
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if skip:
        sequence.fast_forward(int(skip))
    with warnings.catch_warnings():  # pieces of a sequence need not be powers of two
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(sequence.random(int(count)))
