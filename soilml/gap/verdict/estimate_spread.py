"""Spread of the soil's estimates over the effects that may be present."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.least_squares import Solution
from soilml.gap.search.candidate_fits import EFFECT_PENALTY, CandidateFit
from soilml.gap.search.posterior import Posterior
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.evidence import LARGEST_SIZE, SMALLEST_SIZE, TEMPERING
from soilml.gap.statistics.mixture_interval import equivalent_std
from soilml.gap.statistics.signatures import Signature
from soilml.numerics.prior import UNIFORM_PRECISION

Floats = NDArray[np.float64]

#: Sizes, in reference sizes, over whose logarithm the likelihood of an effect is summed.
SIZES = np.geomspace(SMALLEST_SIZE, LARGEST_SIZE, 40)


@dataclass(frozen=True)
class EstimateSpread:
    """Estimates by several explanations: their distance from the stated one, and their weights."""

    offset: Mapping[str, Floats]  # (n,) by path
    weight: Floats  # (n,)

    def std(self, path: str, own: float) -> float:
        """Standard deviation of a parameter whose estimates each have the one `own`."""
        if path not in self.offset:
            return own
        offset = self.offset[path]
        return equivalent_std(offset, np.full_like(offset, own), self.weight)


def among_candidates(
    fit: Solution, candidates: Sequence[CandidateFit], posterior: Posterior
) -> EstimateSpread:
    """The soil by all candidates about that of one fit, by their probabilities.

    Model averaging: Hoeting et al., Statist. Sci. 14(4), 1999, section 1.
    """
    values, others = fit.values(), [c.fit.values() for c in candidates]
    offset = {
        path: np.asarray([other[path] - value for other in others])
        for path, value in values.items()
        if all(path in other for other in others)
    }
    return EstimateSpread(offset, np.asarray([posterior.weight(c.names) for c in candidates]))


def by_undetected_effects(
    problem: FitProblem, soil: Solution, signatures: Sequence[Signature]
) -> EstimateSpread:
    r"""The soil if one of the effects is present, where the soil alone is not rejected.

    The readings may hardly show the effect, or show it as another soil. An effect of size b moves
    the estimates of the soil alone, linearised there, by b d (omitted variables; Greene,
    Econometric Analysis, 7th ed., section 4.3.2):

    .. math:: d = (X^T V^{-1} X + P)^{-1} X^T V^{-1} s

    with its signature s, the Jacobian X and the precision P of the soil's prior. The size has the
    prior of `soilml.gap.statistics.evidence`, times the likelihood of what the soil leaves; an
    effect has prior odds of one to twenty against the soil alone.
    """
    fit = soil.whitened_by(problem.covariance.whiten)
    normal = fit.jacobian.T @ fit.jacobian + np.diag(fit.precision + UNIFORM_PRECISION)
    of_tests = fit.soil_tests.rates(fit.x)
    normal += of_tests.T @ of_tests
    stds = {c.effect: c.std for c in problem.size_coordinates([s.name for s in signatures])}
    logs, offsets = [np.zeros(1)], [np.zeros((1, len(fit.x)))]
    for s in signatures:
        column = problem.covariance.whiten @ s.column
        moved = np.linalg.solve(normal, fit.jacobian.T @ column)
        apart = column - fit.jacobian @ moved
        size, log = _size_posterior(apart, fit.residual, s.sign, stds[s.name])
        logs.append(log)
        offsets.append(size[:, None] * moved)
    log, offset = np.concatenate(logs), np.concatenate(offsets)
    rate = [c.rate(float(x)) for c, x in zip(fit.coordinates, fit.x, strict=True)]
    by_path = {c.path: offset[:, i] * rate[i] for i, c in enumerate(fit.coordinates)}
    return EstimateSpread(by_path, np.exp(log - log.max()))


def _size_posterior(
    column: Floats, residual: Floats, sign: int, std: float
) -> tuple[Floats, Floats]:
    """Sizes (n,) of an effect, and the logarithms of their odds against its absence, (n,).

    `std` is that of a Gaussian prior, infinite for a scale-free size. The likelihood is tempered
    as that of candidates is.
    """
    size = np.concatenate([-SIZES, SIZES]) if sign == 0 else sign * SIZES
    log_prior = np.log(np.abs(size))  # a step of the grid grows with the size
    if np.isfinite(std):
        log_prior -= 0.5 * np.square(size / std)
    else:
        log_prior -= np.log(np.abs(size) + SMALLEST_SIZE)
    log_prior -= np.logaddexp.reduce(log_prior)
    log = log_prior + size * (column @ residual) - 0.5 * size**2 * (column @ column)
    total = float(np.logaddexp.reduce(log))
    return size, log + (TEMPERING - 1.0) * total - 0.5 * EFFECT_PENALTY
