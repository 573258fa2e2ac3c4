"""The posterior of a set from any likelihood of its unknowns: moments, quantiles, the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from training.benchmark.bayes_limit import COMPARED, FRACTIONS, ExactPosterior
from training.set_posterior.response_surface import NEAR
from training.set_posterior.wheel_family import SimulatedSets, WheelFamily

Floats = NDArray[np.float64]

#: With fewer effective samples a posterior is flagged: its mean strays by more than 0.05 of its
#: standard deviation.
LEAST_EFFECTIVE = 400.0


@dataclass(frozen=True)
class ExactSetPosterior(ExactPosterior):
    """A posterior as in `ExactPosterior`, and what calibration asks of it.

    `below` is the share (q,) of the posterior under the truth, uniform over many sets where the
    posterior is right (Cook, Gelman and Rubin, J. Computational and Graphical Statistics 15, 2006).
    `density` and `denser` are of all unknowns together, those that are only nearly known too.
    """

    below: Floats
    effective: float
    evidence: float


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of one set, as fractions u (n, p) of their priors."""

    family: WheelFamily
    near: float
    scale: Floats  # (q,) by which the values of the estimated axes are multiplied

    @staticmethod
    def of(family: WheelFamily, sets: SimulatedSets, index: int) -> Unknowns:
        """Those of a simulated set."""
        given = sets.given(index)
        named = [f"{axis.name}_max" for axis in family.axes[: family.targets]]
        scale = np.asarray([given.get(name, 1.0) for name in named])
        return Unknowns(family, float(sets.origin.near[index]), scale)

    @property
    def count(self) -> int:
        """How many there are; nearly known axes that are wholly known do not count."""
        return len(self.family.axes) if self.near > 0.0 else self.family.free

    def x(self, u: Floats) -> Floats:
        """Coordinates (n, all axes)."""
        free = self.family.free
        found = np.zeros((len(u), len(self.family.axes)))
        for i, axis in enumerate(self.family.axes[:free]):
            found[:, i] = axis.drawn(u[:, i])
        if self.near > 0.0:
            low, high = ndtr(-NEAR), ndtr(NEAR)
            found[:, free:] = self.near * ndtri(low + (high - low) * u[:, free:])
        return found

    def values(self, x: Floats) -> Floats:
        """Estimated parameters (n, q) at coordinates."""
        axes = self.family.axes[: self.family.targets]
        return np.stack([axis.value(x[:, i]) for i, axis in enumerate(axes)], axis=1) * self.scale


def posterior(
    unknowns: Unknowns, log_likelihood: Callable[[Floats], Floats], truth: Floats
) -> tuple[ExactSetPosterior, ImportanceSample]:
    """The posterior under a log likelihood of coordinates (n, axes), with the truth's (axes,)."""
    found = importance_sample(lambda u: log_likelihood(unknowns.x(u)), unknowns.count)
    values = unknowns.values(unknowns.x(found.u))
    mean = found.mean(values)
    off = values - mean
    places = (np.arange(COMPARED) + 0.5) / COMPARED
    drawn = np.searchsorted(np.cumsum(found.weights), places).clip(max=len(found.u) - 1)
    logs = log_likelihood(np.vstack([truth, unknowns.x(found.u[drawn])]))
    own = unknowns.values(truth[None])
    return ExactSetPosterior(
        mean=mean,
        covariance=(off.T * found.weights) @ off,
        quantiles=found.quantiles(values, np.asarray(FRACTIONS)),
        density=float(logs[0]) - found.evidence,
        denser=float(np.mean(logs[1:] > logs[0])),
        flagged=found.effective < LEAST_EFFECTIVE,
        below=found.weights @ (values < own),
        effective=found.effective,
        evidence=found.evidence,
    ), found
