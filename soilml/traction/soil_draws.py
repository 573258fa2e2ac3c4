"""Equally weighted draws of soil parameters, from the prior or the posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.readings import Readings
from soilml.identification.condensing import condensed
from soilml.identification.posterior import PosteriorSamples, posterior_samples
from soilml.identification.prior_fractions import prior_fractions
from soilml.numerics.resampling import systematic_resampling

Floats = NDArray[np.float64]

#: Number of draws: the probability below a 5 % quantile of as many has a standard error of 1.1 %.
DRAWS = 400


@dataclass(frozen=True)
class SoilDraws:
    """Equally weighted draws (n, p) of the parameters `names`, in SI units."""

    names: tuple[str, ...]
    values: Floats

    def of(self, case: Case, rows: NDArray[np.int64]) -> Case:
        """The case with the values of these draws as arrays of the shape of `rows`."""
        known = case.parameters()
        kept = {n: self.values[rows, i] for i, n in enumerate(self.names) if n in known}
        return case.with_values(kept)


@dataclass(frozen=True)
class PosteriorDraws:
    """Equally weighted draws of the posterior, and the weighted samples that they come from."""

    draws: SoilDraws
    samples: PosteriorSamples


def posterior_draws(
    case: Case, readings: Readings, free: Sequence[Coordinate], count: int = DRAWS, seed: int = 0
) -> PosteriorDraws:
    """Draws of the posterior of the rows; raises `FitError` as the posterior method does."""
    found = posterior_samples(case, condensed(case, readings, free), free)
    offset = np.random.default_rng(seed).random()
    rows = systematic_resampling(found.sample.weights, count, offset)
    return PosteriorDraws(_soil_draws(free, found.sample.u[rows]), found)


def prior_draws(
    free: Sequence[Coordinate], count: int = DRAWS, seed: int = 0, case: Case | None = None
) -> SoilDraws:
    """Draws of the priors by Latin hypercube; tests of the case's soil take part."""
    return _soil_draws(free, prior_fractions(free, count, np.random.default_rng(seed), case))


def _soil_draws(free: Sequence[Coordinate], u: Floats) -> SoilDraws:
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    return SoilDraws(tuple(f.path for f in free), values)
