"""Adaptive multiple importance sampling of a density in the unit cube."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import (
    effective_size,
    latin_hypercube,
    systematic_resampling,
    weighted_quantiles,
)

#: Samples of the first round, stratified over the cube, and of each round after it.
FIRST_ROUND, LATER_ROUND = 2048, 2048
MOST_ROUNDS = 24  # Most adaptive rounds
#: Effective sample size at which sampling ends: sampling error of a mean is then 1 / sqrt(2500),
#: 2 % of the standard deviation.
LEAST_EFFECTIVE_SIZE = 2500.0
#: Effective sample size that a mixture is made of; below it the density is tempered.
FITTED_SIZE = 150.0
BISECTIONS = 30  # Bisections of the tempering exponent
#: Kernels of a mixture, the degrees of freedom of their t distributions (four: tails heavy enough
#: to cover a density that the mixture has missed), and the uniform fraction of every proposal.
KERNELS, FREEDOM, UNIFORM = 64, 4.0, 0.1


@dataclass(frozen=True)
class ImportanceSample:
    """Samples (n, p) in the unit cube with weights (n,) that sum to one."""

    u: Floats
    weights: Floats
    evidence: float  # logarithm of the mean of the density over the cube

    @property
    def effective_size(self) -> float:
        """Effective sample size."""
        return effective_size(self.weights)

    def mean(self, values: Floats) -> Floats:
        """Mean of values (n, ...) under the density."""
        return np.asarray(np.tensordot(self.weights, values, axes=1))

    def quantiles(self, values: Floats, fractions: Floats) -> Floats:
        """Quantiles (k, q) of columns of values (n, q) at fractions (k,)."""
        return weighted_quantiles(values, self.weights, fractions)


def importance_sample(
    log_density: Callable[[Floats], Floats],
    p: int,
    seed: int = 0,
    least_effective_size: float = LEAST_EFFECTIVE_SIZE,
    around: tuple[Floats, Floats] | None = None,
    most_samples: float = math.inf,
    later: int = LATER_ROUND,
) -> ImportanceSample:
    r"""Weighted samples of a density over the unit cube that is known up to a factor.

    The first round is a Latin hypercube. Each later round is drawn from a mixture of kernels, t
    distributions about some of all samples so far, a tenth of it uniform, and every sample is
    weighted by the mean of all rounds' proposals:

    .. math:: w_i \propto \pi(u_i) / \sum_k n_k q_k(u_i)

    While few samples carry the weight, the mixture is that of a tempered density, the largest power
    of it that enough samples share. Consistent for any density, as every proposal covers the
    cube.

    log_density: Logarithm (n,) of the density at points (n, p); -inf where it vanishes.
    p: Dimension.
    seed: Of the random numbers.
    least_effective_size: Effective sample size at which sampling ends.
    around: Middle (p,) of a density that is similar to this one, and a root (p, p) of its
        covariance. The first round is then drawn from it: of many dimensions, or a narrow density,
        hardly any point of a Latin hypercube is where the density is.
    most_samples: Number of samples at which sampling ends anyway.
    later: Samples of each round after the first; fewer suit a density that costs much.

    References: Cornuet, Marin, Mira and Robert, Scandinavian J. Statistics 39(4), 2012 (adaptive
    multiple importance sampling); West, J. R. Statist. Soc. B 55(2), 1993 (mixtures of kernels).
    """
    rng = np.random.default_rng(seed)
    mixtures: list[_Mixture] = []
    if around is None:
        u, uniform = latin_hypercube(FIRST_ROUND, p, rng), float(FIRST_ROUND)
    else:
        mixtures.append(_Mixture(around[0][None], around[1]))
        u, uniform = _inside(mixtures[0].draw(later, rng)), 0.0
    logs = log_density(u)
    # proposals: sum over rounds of n_k q_k at each sample
    proposals = uniform + sum((later * m.density(u) for m in mixtures), np.zeros(len(u)))
    sample = _weighted(u, logs, proposals)
    for _ in range(MOST_ROUNDS):
        enough = sample.effective_size >= least_effective_size or len(u) >= most_samples
        if enough or not np.isfinite(logs).any():
            break
        mixture = _Mixture.of(u, _tempered_weights(logs, proposals), rng)
        new = _inside(mixture.draw(later, rng))
        earlier = sum((later * m.density(new) for m in mixtures), np.zeros(len(new)))
        at_new = uniform + earlier + later * mixture.density(new)
        proposals = np.append(proposals + later * mixture.density(u), at_new)
        u = np.vstack([u, new])
        logs = np.append(logs, log_density(new))
        mixtures.append(mixture)
        sample = _weighted(u, logs, proposals)
    return sample


def _inside(u: Floats) -> Floats:
    """The points (n, p) in the cube."""
    return u[np.all((u > 0.0) & (u < 1.0), axis=1)]


def _weighted(u: Floats, logs: Floats, proposals: Floats) -> ImportanceSample:
    """Samples with normalised weights; equal ones where the density vanishes at all of them."""
    top = float(np.max(logs, initial=-math.inf))
    if not math.isfinite(top):
        return ImportanceSample(u, np.full(len(u), 1.0 / len(u)), -math.inf)
    weights = np.exp(logs - top) / proposals
    return ImportanceSample(u, weights / weights.sum(), top + math.log(float(weights.sum())))


def _tempered_weights(logs: Floats, proposals: Floats) -> Floats:
    """Weights of the highest power of the density with an effective size of `FITTED_SIZE`."""
    positive = np.isfinite(logs)
    relative = np.where(positive, logs - np.max(logs), 0.0)

    def weights(power: float) -> Floats:
        products = positive * np.exp(power * relative) / proposals
        return np.asarray(products / products.sum())

    if effective_size(weights(1.0)) >= FITTED_SIZE:
        return weights(1.0)
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        power = 0.5 * (low + high)
        enough = effective_size(weights(power)) >= FITTED_SIZE
        low, high = (power, high) if enough else (low, power)
    return weights(low)


@dataclass(frozen=True)
class _Mixture:
    """Equal t distributions: centres (k, p), and the Cholesky factor (p, p) of their scale."""

    centres: Floats
    factor: Floats

    @staticmethod
    def of(u: Floats, weights: Floats, rng: np.random.Generator) -> _Mixture:
        r"""Kernels about some of weighted samples (n, p), with their mean and covariance.

        .. math:: m_j = \bar u + \sqrt{1 - h^2}\,(u_j - \bar u), \quad h = k^{-1 / (p + 4)}

        and the scale h^2 times the covariance: without shrinking the centres, the mixture would be
        wider than the samples.
        """
        p = u.shape[1]
        mean = weights @ u
        covariance = ((u - mean).T * weights) @ (u - mean) + 1e-10 * np.eye(p)
        width = KERNELS ** (-1.0 / (p + 4))
        chosen = u[systematic_resampling(weights, KERNELS, rng.random())]
        centres = mean + math.sqrt(1.0 - width**2) * (chosen - mean)
        return _Mixture(centres, width * np.linalg.cholesky(covariance))

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Points (count, p), a fraction `UNIFORM` of them uniform; some lie outside the cube."""
        p = self.centres.shape[1]
        normal = rng.standard_normal((count, p)) @ self.factor.T
        stretch = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, count))
        about = self.centres[rng.integers(len(self.centres), size=count)]
        from_t = about + normal * stretch[:, None]
        uniform = rng.random(count) < UNIFORM
        return np.where(uniform[:, None], rng.random((count, p)), from_t)

    def density(self, u: Floats) -> Floats:
        """Density (n,) at points of the cube, uniform fraction included."""
        p = self.centres.shape[1]
        constant = math.lgamma(0.5 * (FREEDOM + p)) - math.lgamma(0.5 * FREEDOM)
        constant -= 0.5 * p * math.log(FREEDOM * math.pi) + np.log(np.diag(self.factor)).sum()
        white, centres = (np.linalg.solve(self.factor, x.T).T for x in (u, self.centres))
        squares = np.zeros((len(u), len(centres)))
        for i in range(p):
            squares += (white[:, i, None] - centres[:, i]) ** 2
        of_each = (1.0 + squares / FREEDOM) ** (-0.5 * (FREEDOM + p))
        return np.asarray(UNIFORM + (1.0 - UNIFORM) * math.exp(constant) * of_each.mean(axis=1))
