"""Readings of the rover's sensors: true values with noise and bias."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import SENSOR_COLUMNS, Recipe
from soilml.physics.contact import Force

Floats = NDArray[np.float64]


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
            noise = _normal((recipe.seed, block, position, 1), row)
            reading += recipe.case.noise[name].std(true) * noise
        if name in recipe.bias:
            reading += recipe.bias[name].std(true) * _normal((recipe.seed, block, position, 2), run)
        if name == "slip":
            reading = np.clip(reading, -0.999, 0.999)
        if name == "load_N":
            reading = np.maximum(reading, 1e-3 * true)
        readings[name] = reading
    return readings


def true_values(slip: Floats, load: Floats, force: Force) -> dict[str, Floats]:
    """The true values of the measured columns, (n,), SI."""
    return {
        "slip": slip,
        "load_N": load,
        "torque_Nm": force.torque,
        "drawbar_pull_N": force.drawbar_pull,
        "sinkage_m": force.sinkage,
    }


def _normal(seed: tuple[int, ...], index: NDArray[np.int64]) -> Floats:
    """Standard normal numbers by index, from a counter-based generator."""
    first, last = int(index[0]), int(index[-1]) + 1
    start = first - first % 4  # Philox generates four words at a time
    generator = np.random.Philox(np.random.SeedSequence(seed))
    generator.advance(start // 4)
    uniform = np.random.Generator(generator).random(last - start)[first - start :]
    from scipy.special import ndtri

    normal = ndtri(np.clip(uniform, 1e-16, 1.0 - 1e-16))
    return np.asarray(normal[index - first])
