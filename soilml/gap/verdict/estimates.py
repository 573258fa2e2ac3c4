"""Estimates of soil and effects with their intervals, and the case that has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy, unestimated_bias
from soilml.config.remainder import Remainder
from soilml.fitting.coordinates import rates_at
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.marginal_likelihood import LARGEST_SIZE, SMALLEST_SIZE, TEMPERING
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.posterior import Posterior
from soilml.numerics.prior import Prior
from soilml.quantities import Z_90
from soilml.report.numbers import significant
from soilml.results import EstimatedValue

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
    fit: Solution, candidates: Sequence[Explanation], posterior: Posterior
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
    prior of `soilml.gap.evidence.marginal_likelihood`, times the likelihood of what the soil
    leaves; an effect has the prior odds of `soilml.gap.evidence.prior_odds` against the soil
    alone.
    """
    fit = soil.whitened_by(problem.covariance.whiten)
    stds = {c.effect: c.std for c in problem.size_coordinates([s.name for s in signatures])}
    logs, offsets = [np.zeros(1)], [np.zeros((1, len(fit.x)))]
    for s in signatures:
        column = problem.covariance.whiten @ s.column
        moved = np.linalg.solve(fit.information, fit.jacobian.T @ column)
        apart = column - fit.jacobian @ moved
        size, log = _size_posterior(apart, fit.residual, s.sign, stds[s.name])
        logs.append(log - 0.5 * problem.penalties[s.name])
        offsets.append(size[:, None] * moved)
    log, offset = np.concatenate(logs), np.concatenate(offsets)
    rate = rates_at(fit.coordinates, fit.x)
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
    return size, log + (TEMPERING - 1.0) * total


COVERAGE = 0.90  # Probability of the interval by which a mixture is summarised
#: Halvings of the interval in which the half width is sought: a relative error of 1e-9.
HALVINGS = 30


def equivalent_std(offset: Floats, std: Floats, weight: Floats) -> float:
    r"""Standard deviation of the normal distribution with the same central 90 % interval.

    The half width h of the interval about zero contains 90 % of the mixture:

    .. math::
        \sum_i w_i [\Phi((h - \mu_i) / \sigma_i) - \Phi((-h - \mu_i) / \sigma_i)] = 0.9

    A mixture's own standard deviation depends on its tails: where an unlikely component lies far
    away, 1.645 of them hold far more than 90 %.

    offset, std, weight (n,): Mean, standard deviation and weight of each component; weights need
        not sum to one.
    """
    from scipy.special import ndtr

    share = weight / weight.sum()
    low, high = 0.0, float(np.max(np.abs(offset) + Z_90 * std))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        inside = share @ (ndtr((middle - offset) / std) - ndtr((-middle - offset) / std))
        low, high = (middle, high) if inside < COVERAGE else (low, middle)
    return 0.5 * (low + high) / Z_90


PRIOR_HALF_WIDTH = 3.0  # Half width of the prior of an effect's size, in standard deviations


def updated_case(
    fit: Solution,
    discrepancy: dict[str, float] | None = None,
    remainder: Remainder | None = None,
) -> Case:
    """The fitted case: soil and effects at their optimum, with the priors and noise of the input.

    Values are rounded to significant digits.

    The size of each effect gets a uniform prior of three standard deviations to either side, so
    that its uncertainty is propagated where the model is used. `discrepancy` has the standard
    deviations of the smooth discrepancy by column, in the column's unit; None keeps what the case
    declares. An error of a sensor that is fitted as an effect is no longer a bias. `remainder` is
    what the fit leaves and was learned; None keeps that of the case.
    """
    values, stds = {path: significant(v) for path, v in fit.values().items()}, fit.stds()
    case = fit.case.with_values(values)
    prior = dict(fit.case.prior)
    bounds = {path: parameter for path, (parameter, _) in case.parameters().items()}
    for c in fit.coordinates:
        if not c.effect or c.is_shape:
            continue
        value, reach = values[c.path], PRIOR_HALF_WIDTH * stds[c.path]
        lower = max(bounds[c.path].lower, significant(value - reach))
        upper = min(bounds[c.path].upper, significant(value + reach))
        if lower < upper:
            prior[c.path] = Prior(lower, upper)
    remaining = dict(fit.case.discrepancy)
    if discrepancy is not None:
        declared = next(iter(remaining.values()), Discrepancy())
        remaining = {
            name: replace(declared, share=0.0, constant=significant(std), learned=True)
            for name, std in discrepancy.items()
        }
    bias = unestimated_bias(fit.case.bias, set(fit.effects))
    return replace(
        case,
        prior=prior,
        noise=dict(fit.case.noise),
        discrepancy=remaining,
        bias=bias,
        remainder=case.remainder if remainder is None else remainder,
    )


def soil_estimates(
    fit: Solution, spread: EstimateSpread | None = None
) -> dict[str, EstimatedValue]:
    """The soil parameters of a fit, by name.

    With `spread`, each standard deviation is that of the normal distribution whose 90 % interval
    is as wide as the one over all explanations.
    """
    values, stds = fit.values(), fit.stds()
    if spread is not None:
        stds = {path: spread.std(path, own) for path, own in stds.items()}
    return {
        c.name: EstimatedValue(values[c.path], stds[c.path], c.unit)
        for c in fit.coordinates
        if (not c.effect)
    }


def effect_estimates(fit: Solution, effect: str) -> dict[str, EstimatedValue]:
    """The parameters of one effect of a fit, by name."""
    values, stds = fit.values(), fit.stds()
    return {
        c.name: EstimatedValue(values[c.path], stds[c.path], c.unit)
        for c in fit.coordinates
        if c.effect and c.effect == effect
    }
