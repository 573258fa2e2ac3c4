"""Weighted samples of a density in the unit cube, by importance sampling that learns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.resampling import effective_size, latin_hypercube, weighted_quantiles

Floats = NDArray[np.float64]

#: Samples of the first round, spread over the cube, and of each round after it.
FIRST, ROUND = 2048, 2048
MOST_ROUNDS = 24
#: Effective samples that are enough: means then stray by 2 % of the standard deviation.
LEAST_EFFECTIVE_SIZE = 2500.0
#: Effective samples that a mixture is fitted to; fewer, and the density is tempered for it.
FITTED = 150.0
#: Components of the mixture, their degrees of freedom, and the share that stays uniform.
COMPONENTS, FREEDOM, UNIFORM = 6, 4.0, 0.1


@dataclass(frozen=True)
class ImportanceSample:
    """Samples (n, p) in the unit cube with weights (n,) that sum to one."""

    u: Floats
    weights: Floats
    #: log of the mean of the density over the cube
    evidence: float

    @property
    def effective(self) -> float:
        """Effective sample size."""
        return effective_size(self.weights)

    def mean(self, values: Floats) -> Floats:
        """Mean of values (n, ...) under the density."""
        return np.asarray(np.tensordot(self.weights, values, axes=1))

    def quantiles(self, values: Floats, fractions: Floats) -> Floats:
        """Quantiles (k, q) of columns of values (n, q) at fractions (k,)."""
        return weighted_quantiles(values, self.weights, fractions)


def importance_sample(
    log_density: Callable[[Floats], Floats], p: int, seed: int = 0
) -> ImportanceSample:
    r"""Samples of a density over the unit cube, known up to a factor; -inf where it is nil.

    The first round is spread over the cube. Each round after it is drawn from a mixture of t
    distributions fitted to all samples so far, a tenth of it uniform, and every sample is weighed
    by the mean of all rounds' proposals:

    .. math:: w_i \propto \pi(u_i) / \sum_k n_k q_k(u_i)

    While few samples carry the weight, the mixture is fitted to a power of the density that more
    of them share. Exact in the limit of many rounds whatever the density, for every proposal
    covers the cube. References: Cornuet, Marin, Mira and Robert, Scandinavian J. Statistics 39(4),
    2012 (adaptive multiple importance sampling).
    """
    rng = np.random.default_rng(seed)
    u = latin_hypercube(FIRST, p, rng)
    logs = log_density(u)
    mixtures: list[_Mixture] = []
    drawn = np.full(len(u), float(FIRST))  # sum over rounds of n_k q_k at each sample
    found = _weighed(u, logs, drawn)
    for _ in range(MOST_ROUNDS):
        if found.effective >= LEAST_EFFECTIVE_SIZE or not np.isfinite(logs).any():
            break
        mixture = _fitted(u, _tempered(logs, drawn), rng)
        new = mixture.draw(ROUND, rng)
        inside = np.all((new > 0.0) & (new < 1.0), axis=1)
        fresh = new[inside]
        old = float(FIRST) + sum((ROUND * m.density(fresh) for m in mixtures), np.zeros(len(fresh)))
        drawn = np.append(drawn + ROUND * mixture.density(u), old + ROUND * mixture.density(fresh))
        u = np.vstack([u, fresh])
        logs = np.append(logs, log_density(fresh))
        mixtures.append(mixture)
        found = _weighed(u, logs, drawn)
    return found


def _weighed(u: Floats, logs: Floats, drawn: Floats) -> ImportanceSample:
    top = float(np.max(logs, initial=-math.inf))
    if not math.isfinite(top):
        return ImportanceSample(u, np.full(len(u), 1.0 / len(u)), -math.inf)
    weights = np.exp(logs - top) / drawn
    return ImportanceSample(u, weights / weights.sum(), top + math.log(float(weights.sum())))


def _tempered(logs: Floats, drawn: Floats) -> Floats:
    """Weights of the highest power of the density that enough samples share."""
    live = np.isfinite(logs)
    kept = np.where(live, logs - np.max(logs), 0.0)

    def weights(power: float) -> Floats:
        found = live * np.exp(power * kept) / drawn
        return np.asarray(found / found.sum())

    if 1.0 / np.sum(weights(1.0) ** 2) >= FITTED:
        return weights(1.0)
    low, high = 0.0, 1.0
    for _ in range(30):
        power = 0.5 * (low + high)
        enough = 1.0 / np.sum(weights(power) ** 2) >= FITTED
        low, high = (power, high) if enough else (low, power)
    return weights(low)


@dataclass(frozen=True)
class _Mixture:
    """t distributions with centres (k, p), lower factors of their scales (k, p, p), shares (k,)."""

    centres: Floats
    factors: Floats
    shares: Floats

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        p = self.centres.shape[1]
        which = rng.choice(len(self.shares), count, p=self.shares)
        normal = np.einsum("nij,nj->ni", self.factors[which], rng.standard_normal((count, p)))
        stretch = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, count))
        found = self.centres[which] + normal * stretch[:, None]
        uniform = rng.random(count) < UNIFORM
        return np.where(uniform[:, None], rng.random((count, p)), found)

    def density(self, u: Floats) -> Floats:
        """Density (n,) at points of the cube, uniform share included."""
        p = self.centres.shape[1]
        constant = math.lgamma(0.5 * (FREEDOM + p)) - math.lgamma(0.5 * FREEDOM)
        constant -= 0.5 * p * math.log(FREEDOM * math.pi)
        total = np.full(len(u), UNIFORM)
        for centre, factor, share in zip(self.centres, self.factors, self.shares, strict=True):
            off = np.linalg.solve(factor, (u - centre).T)
            log = constant - np.log(np.diag(factor)).sum()
            log = log - 0.5 * (FREEDOM + p) * np.log1p((off**2).sum(axis=0) / FREEDOM)
            total += (1.0 - UNIFORM) * share * np.exp(log)
        return total


def _fitted(u: Floats, weights: Floats, rng: np.random.Generator) -> _Mixture:
    """A mixture for weighted samples, by expectation and maximisation from scattered centres."""
    kept = weights > 1e-12 * weights.max()
    u, weights = u[kept], weights[kept] / weights[kept].sum()
    n, p = u.shape
    k = min(COMPONENTS, n)
    mean = weights @ u
    spread = ((u - mean).T * weights) @ (u - mean) + 1e-10 * np.eye(p)
    centres = u[rng.choice(n, k, replace=False, p=None if k == n else weights)] if k < n else u
    scales = np.tile(spread / k ** (2.0 / p), (k, 1, 1))
    shares = np.full(k, 1.0 / k)
    for _ in range(12):
        member = np.stack(
            [
                share * _bell(u, centre, scale)
                for centre, scale, share in zip(centres, scales, shares, strict=True)
            ]
        )
        member = member / np.maximum(member.sum(axis=0), 1e-300) * weights
        mass = member.sum(axis=1)
        shares = mass / mass.sum()
        centres = (member @ u) / np.maximum(mass, 1e-300)[:, None]
        for i in range(k):
            off = u - centres[i]
            own = (off.T * member[i]) @ off / max(mass[i], 1e-300)
            scales[i] = 0.95 * own + 0.05 * spread / k ** (2.0 / p)
    live = shares > 1e-6
    return _Mixture(
        centres[live], np.linalg.cholesky(scales[live]), shares[live] / shares[live].sum()
    )


def _bell(u: Floats, centre: Floats, scale: Floats) -> Floats:
    """Gaussian density (n,), up to a factor that all components share."""
    factor = np.linalg.cholesky(scale)
    off = np.linalg.solve(factor, (u - centre).T)
    return np.asarray(np.exp(-0.5 * (off**2).sum(axis=0)) / np.prod(np.diag(factor)))
