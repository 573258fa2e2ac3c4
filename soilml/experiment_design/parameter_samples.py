"""Weighted samples of the parameters: of a prior, or of a posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.readings import Readings
from soilml.identification.averaged import soil_samples
from soilml.identification.posterior import prior_fractions

SAMPLES = 2048  # Default number of samples


@dataclass(frozen=True)
class ParameterSamples:
    """Samples u (n, p), as fractions of the priors of `free`, with weights (n,) that sum to one.

    `noise_scale` multiplies the declared noise of further rows: above 1 where the residuals of
    earlier rows exceed it.
    """

    free: tuple[Coordinate, ...]
    u: Floats
    weights: Floats
    noise_scale: float = 1.0

    @property
    def standardised(self) -> Floats:
        """Values less their mean, in standard deviations of the prior, (n, p)."""
        value = np.stack(
            [f.prior.at(self.u[:, i]) / f.prior.std for i, f in enumerate(self.free)], axis=1
        )
        return np.asarray(value - self.weights @ value)

    @property
    def remaining_fraction(self) -> Floats:
        """Standard deviation over that of the prior, (p,)."""
        return np.sqrt(self.weights @ self.standardised**2)


def samples_of_prior(
    free: Sequence[Coordinate], count: int = SAMPLES, seed: int = 0, case: Case | None = None
) -> ParameterSamples:
    """Samples of the prior by Latin hypercube, equally weighted.

    The tests of the case's soil, if there are any, take part.
    """
    u = prior_fractions(free, count, np.random.default_rng(seed), case)
    return ParameterSamples(tuple(free), u, np.full(count, 1.0 / count))


def samples_of_rows(
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    count: int = SAMPLES,
    exact_model: bool = False,
) -> ParameterSamples:
    """Samples of the soil that explains rows, averaged over explanations as by `identify`.

    With `exact_model`, those of the exact posterior. Raises `FitError` as `identify` does, and
    where noise is not declared.
    """
    found = soil_samples(case, readings, free, exact_model)
    index, multiplicity = np.unique(found.equally_weighted(count), return_counts=True)
    weights = multiplicity / multiplicity.sum()
    return ParameterSamples(tuple(free), found.sample.u[index], weights, found.noise_scale)
