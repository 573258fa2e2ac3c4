"""Equally weighted draws of a prior, with the tests of the soil in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.soil_tests import SoilTestTerms
from soilml.numerics.resampling import latin_hypercube, systematic_resampling

Floats = NDArray[np.float64]

#: Draws of the priors from which one is chosen by the tests of the soil.
CANDIDATES = 64


def prior_fractions(
    free: Sequence[Coordinate], count: int, rng: np.random.Generator, case: Case | None = None
) -> Floats:
    """Fractions (count, p) of the priors by Latin hypercube; tests of the case's soil take part.

    With tests, draws are chosen with probabilities in proportion to their density.
    """
    if case is None or not case.soil_tests:
        return latin_hypercube(count, len(free), rng)
    u = latin_hypercube(CANDIDATES * count, len(free), rng)
    logs = -0.5 * (SoilTestTerms(case, free).deviation(u) ** 2).sum(axis=1)
    weights = np.exp(logs - logs.max())
    chosen = systematic_resampling(weights / weights.sum(), count, rng.random())
    return np.asarray(u[rng.permutation(chosen)])
