"""What is believed of the parameters before the next measurement, as weighted samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import erf, sqrt

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.posterior import settled_samples
from soilml.numerics.maximum_entropy import prior_quantiles
from soilml.numerics.resampling import latin_hypercube, systematic_resampling

Floats = NDArray[np.float64]

#: Samples that a belief is thinned to where nothing else is asked for.
SAMPLES = 2048


@dataclass(frozen=True)
class ParameterSamples:
    """Samples u (n, p), as fractions of the priors of `free`, with weights (n,) that sum to one.

    `larger` multiplies the declared noise: rows that scatter more than declared will again.
    """

    free: tuple[FreeParameter, ...]
    u: Floats
    weights: Floats
    larger: float = 1.0

    @property
    def shares(self) -> Floats:
        """The samples' values in standard deviations of the prior, (n, p), about their mean."""
        value = np.stack(
            [f.prior.at(self.u[:, i]) / f.prior.std for i, f in enumerate(self.free)], axis=1
        )
        return np.asarray(value - self.weights @ value)

    @property
    def left(self) -> Floats:
        """The width that is left of each prior, (p,): 1 where nothing is known."""
        return np.sqrt(self.weights @ self.shares**2)


def samples_of_prior(
    free: Sequence[FreeParameter], count: int = SAMPLES, seed: int = 0
) -> ParameterSamples:
    """Nothing was measured: the prior, one sample in each slice of every parameter."""
    rng = np.random.default_rng(seed)
    return ParameterSamples(
        tuple(free), latin_hypercube(count, len(free), rng), np.full(count, 1.0 / count)
    )


def samples_of_rows(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    count: int = SAMPLES,
    seed: int = 0,
) -> ParameterSamples:
    """The exact posterior of measured rows; raises `FitError` as the posterior method does."""
    found, misfit, surplus = settled_samples(case, data, free)
    larger = float(np.sqrt(misfit)) if surplus else 1.0
    index, times = np.unique(
        systematic_resampling(found.weights, count, np.random.default_rng(seed).random()),
        return_counts=True,
    )
    return ParameterSamples(tuple(free), found.u[index], times / times.sum(), larger)


def samples_of_moments(
    free: Sequence[FreeParameter],
    names: Sequence[str],
    mean: Floats,
    covariance: Floats,
    count: int = SAMPLES,
    seed: int = 0,
) -> ParameterSamples:
    """Mean (q,) and covariance (q, q) of some parameters, as a model file estimates them.

    Each lies as `prior_quantiles` says, the correlations are those of a Gaussian (a Gaussian
    copula); parameters that are not named are as their prior. An approximation: a posterior whose
    ridge is bent is not told by its moments.
    """
    rng = np.random.default_rng(seed)
    u = latin_hypercube(count, len(free), rng)
    std = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(std, std)
    size = np.linalg.cholesky(0.999 * correlation + 0.001 * np.eye(len(names)))
    normal = rng.standard_normal((count, len(names))) @ size.T
    below = 0.5 * (1.0 + np.vectorize(erf)(normal / sqrt(2.0)))
    place: Mapping[str, int] = {f.path: i for i, f in enumerate(free)}
    for k, name in enumerate(names):
        if name in place:
            prior = free[place[name]].prior
            u[:, place[name]] = prior_quantiles(prior, float(mean[k]), float(std[k]), below[:, k])
    return ParameterSamples(tuple(free), u, np.full(count, 1.0 / count))
