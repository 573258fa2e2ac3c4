"""The first points of a scrambled Sobol sequence, tabulated: scipy.stats takes long to import."""

from __future__ import annotations

from importlib import resources

import numpy as np
from numpy.typing import NDArray

#: Points of the table, and the most dimensions that it has.
POINTS, MOST_DIMENSIONS = 64, 8
#: Seed of the scrambling, and bits of a coordinate.
SEED, BITS = 7, 30


def sobol_points(dimensions: int) -> NDArray[np.float64]:
    """The first `POINTS` points (64, dimensions) of a scrambled Sobol sequence in [0, 1).

    They are those of ``scipy.stats.qmc.Sobol(dimensions, scramble=True, rng=7)``, which computes
    them where there are more than eight dimensions. The table `sobol_points.npy` has their integer
    coordinates (36, 64): one row for the only dimension, then two rows, and so on.
    """
    if dimensions > MOST_DIMENSIONS:
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(dimensions, scramble=True, rng=SEED).random(POINTS))
    table = resources.files("soilml.numerics").joinpath("sobol_points.npy")
    with table.open("rb") as opened:
        integers = np.load(opened, allow_pickle=False)
    first = dimensions * (dimensions - 1) // 2
    return np.asarray(integers[first : first + dimensions].T * 2.0**-BITS)
