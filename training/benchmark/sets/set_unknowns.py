"""The posterior of a simulated set from any likelihood of its unknowns, with calibration ranks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from soilml.numerics.resampling import systematic_resampling
from soilml.numerics.sampling.importance_sampling import ImportanceSample, importance_sample
from training.benchmark.bayes_limit_file import (
    FRACTIONS,
    HPD_DRAWS,
    PosteriorSummary,
)
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily

Floats = NDArray[np.float64]

#: A posterior of fewer effective samples is flagged: the Monte Carlo error of its mean exceeds
#: 1 / sqrt(400) = 0.05 of its standard deviation.
MIN_EFFECTIVE_SAMPLES = 400.0


@dataclass(frozen=True)
class RankedPosterior(PosteriorSummary):
    """A `PosteriorSummary` with the statistics of simulation-based calibration.

    `rank` is the posterior probability (q,) of values below the truth: uniform over sets where the
    posterior is exact (Cook, Gelman and Rubin, J. Computational and Graphical Statistics 15, 2006).
    `log_density` and `hpd_level` are of all unknowns jointly, nuisance parameters included.
    """

    rank: Floats
    effective_samples: float
    log_evidence: float


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of one set, as fractions u (n, p) of their priors."""

    family: WheelFamily
    near: float
    scale: Floats  # (q,) by which the values of the estimated axes are multiplied

    @staticmethod
    def of(family: WheelFamily, sets: SimulatedSets, index: int) -> Unknowns:
        """The unknowns of a simulated set."""
        context = sets.context_of(index)
        upper_ends = [f"{axis.name}_max" for axis in family.axes[: family.targets]]
        scale = np.asarray([context.get(name, 1.0) for name in upper_ends])
        return Unknowns(family, float(sets.origin.normal_std[index]), scale)

    @property
    def count(self) -> int:
        """Number of unknowns; without it the nearly known axes where they are exactly known."""
        return len(self.family.axes) if self.near > 0.0 else self.family.free

    def x(self, u: Floats) -> Floats:
        """Coordinates (n, all axes)."""
        free = self.family.free
        x = np.zeros((len(u), len(self.family.axes)))
        for i, axis in enumerate(self.family.axes[:free]):
            x[:, i] = axis.quantile(u[:, i])
        if self.near > 0.0:  # a normal prior, truncated at NORMAL_TRUNCATION standard deviations
            low, high = ndtr(-NORMAL_TRUNCATION), ndtr(NORMAL_TRUNCATION)
            x[:, free:] = self.near * ndtri(low + (high - low) * u[:, free:])
        return x

    def values(self, x: Floats) -> Floats:
        """Estimated parameters (n, q) at coordinates."""
        axes = self.family.axes[: self.family.targets]
        return np.stack([axis.value(x[:, i]) for i, axis in enumerate(axes)], axis=1) * self.scale


def sample_posterior(
    unknowns: Unknowns, log_likelihood: Callable[[Floats], Floats], truth: Floats
) -> tuple[RankedPosterior, ImportanceSample]:
    """The posterior under a log likelihood of coordinates (n, axes); `truth` are coordinates."""
    sample = importance_sample(lambda u: log_likelihood(unknowns.x(u)), unknowns.count)
    values = unknowns.values(unknowns.x(sample.u))
    mean = sample.mean(values)
    deviation = values - mean
    draws = unknowns.x(sample.u[systematic_resampling(sample.weights, HPD_DRAWS, 0.5)])
    log_density = log_likelihood(np.vstack([truth, draws]))
    true_values = unknowns.values(truth[None])
    summary = RankedPosterior(
        mean=mean,
        covariance=(deviation.T * sample.weights) @ deviation,
        quantiles=sample.quantiles(values, np.asarray(FRACTIONS)),
        log_density=float(log_density[0]) - sample.evidence,
        hpd_level=float(np.mean(log_density[1:] > log_density[0])),
        flagged=sample.effective_size < MIN_EFFECTIVE_SAMPLES,
        rank=sample.weights @ (values < true_values),
        effective_samples=sample.effective_size,
        log_evidence=sample.evidence,
    )
    return summary, sample
