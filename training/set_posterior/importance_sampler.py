"""The posterior of a set by adaptive importance sampling, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import (
    Value,
    cholesky_columns,
    concat,
    constant,
    floor,
    gemm,
    log,
    maximum,
    minimum,
    shortcut,
    softmax,
    sqrt,
    tanh,
    where,
)
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.likelihood import Likelihood
from training.set_posterior.misfit_test import Consistency
from training.set_posterior.polynomial_residuals import (
    NearlyKnown,
    PolynomialResiduals,
    gauss_newton,
    within_box,
)
from training.set_posterior.sampling_rounds import (
    ProposalDraws,
    SampleSizes,
    WeightedRound,
    adapted_draws,
    prior_draws,
    sample_round,
    weights_by_effective_size,
)
from training.set_posterior.scale_mixture import ScaledMisfit, ScaleMixture

#: Gauss-Newton steps along the solved axis: from 0 in the prior round, and from the regression on
#: the other coordinates in adapted rounds, which is closer.
PRIOR_STEPS, ADAPTED_STEPS = 2, 1
#: Coordinates are drawn as hyperbolic tangents, up to this one: closer to 1, float32 loses 1 - x^2.
LARGEST_TANH = 1.0 - 1e-6
#: Added to the variances of a proposal, so that the Cholesky factor of coinciding samples exists.
VARIANCE_FLOOR = 1e-6


@dataclass(frozen=True)
class WeightedSample:
    """Weighted samples of a posterior.

    A point is 1 and its coordinates, in the order `order` of the axes.
    """

    points: Value  # (1 + p, n)
    weights: Value  # (1, n), sum 1
    misfit: Value  # (1,) least sum of squared residuals
    count: int  # n
    order: tuple[int, ...]


def add_importance_sampler(
    likelihood: Likelihood, consistency: Consistency, sizes: SampleSizes
) -> WeightedSample:
    r"""Weighted samples of the posterior of residuals that are averaged over scales k.

    .. math:: \log p(x | y) = \sum_i \lambda_i x_i
        + \log \sum_k w_k \exp\left(-\tfrac12 |A_k b(x)|^2\right) + const

    Rows at one operating condition constrain the unknowns to a thin sheet, which points spread over
    the whole space would miss. Therefore all unknowns but one are drawn, and that one, the friction
    angle, is solved for: Gauss-Newton steps move it onto the sheet, and it is drawn around this
    conditional mode with the width of its conditional posterior.

    1. In the first round the other unknowns are drawn from the prior, and the model is taken as
       right: it is but a start. Its mean is the soil at which errors are linear.
    2. In each adapted round their inverse hyperbolic tangents, which are unbounded, are drawn from
       a t distribution with the mean and covariance of the previous round. These moments are those
       of the highest power of the density that enough samples share (`tempering_power`). Before
       the last round, the noise is enlarged if no soil explains the readings (`excess_variance`),
       and the moments are then those of the first round. The friction angle is solved for with the
       mean of the systems by the evidence of their scales.
    3. Rounds are pooled in proportion to their effective sample sizes.

    All draws are constants of the graph that are shifted and scaled: the same set gives the same
    answer.

    likelihood: Of the readings, and the unknowns with their priors.
    consistency: Limits of the set's misfit.
    sizes: Points of each round.

    References: Cornuet et al., Scandinavian J. Statistics 39(4), 2012 (adaptive rounds); Robert and
    Casella, Monte Carlo Statistical Methods, 2004, chapter 4 (conditioning on one unknown given the
    others); Kish, Survey Sampling, 1965 (effective sample size).
    """
    family, response, start = likelihood.family, likelihood.response, likelihood.start()
    unknowns = len(family.axes)
    nearly_known = NearlyKnown.of(family, response, likelihood.context)
    residuals = PolynomialResiduals.of(family, response, nearly_known, start)
    graph = residuals.system.graph
    draws = adapted_draws(unknowns, sizes.adapted)
    prior = prior_draws(family, residuals.order, sizes.prior)
    current = _prior_round(family, residuals, prior)
    basis = _mean_basis(residuals, current)
    soil = basis if nearly_known is None else basis * nearly_known.factors.node("Transpose")
    mixture = likelihood.mixture_at(soil).standardised(nearly_known)
    current = current.reweighed(mixture)
    bounded = np.clip(prior.others[:-1], -LARGEST_TANH, LARGEST_TANH)
    unbounded = constant(graph, np.arctanh(bounded))
    rounds, count = [current], sizes.prior
    least = np.diag([0.0, *[VARIANCE_FLOOR] * unknowns])
    variance = one = constant(graph, np.ones(1))
    samples = first_samples = _with_ones(unbounded, current, unknowns, count)
    for number in range(sizes.rounds):
        weights = rounds[-1].tempered_weights()[0]
        moments = _moments(samples, weights, least)
        residuals = mixture.proposal(residuals, found_at(rounds[-1]), weights)
        if number == sizes.rounds - 1:
            variance = excess_variance(least_misfit(rounds), consistency, family.targets)
            mixture = mixture.divided_by(sqrt(variance))
            residuals = residuals.with_system(residuals.system / sqrt(variance))
            moments = shortcut(
                variance <= 1.0,
                lambda found, *_: found,
                partial(_moments_of_likelihood, least=least),
                *(moments, first_samples, found_at(rounds[0]).least, variance),
            )
        proposal = cholesky_columns(moments, unknowns) @ draws.others
        unbounded, current = _adapted_round(family, residuals, mixture, proposal, draws)
        rounds.append(current)
        samples = _with_ones(unbounded, current, unknowns, sizes.adapted)
        count += sizes.adapted
    points = concat([r.points for r in rounds], axis=1)
    misfit = minimum(least_misfit(rounds[:-1]), least_misfit(rounds[-1:]) * variance)
    # the rounds before the last are samples of the posterior with the noise as it was given
    weights = pooled_weights(rounds, floor(one / variance))
    return WeightedSample(points, weights, misfit, count, residuals.order)


def _with_ones(unbounded: Value, current: WeightedRound, unknowns: int, count: int) -> Value:
    """1, the unbounded other coordinates and the solved one of a round, (1 + p, n)."""
    solved = current.points.take([unknowns], axis=0)
    ones = constant(unbounded.graph, np.ones((1, count)))
    return concat([ones, unbounded, solved], axis=0)


def _moments(samples: Value, weights: Value, floor: Floats) -> Value:
    """Second moments (1 + p, 1 + p) of weighted samples, with their least variances added."""
    return gemm(samples * weights, samples, floor, transpose_b=True)


def _moments_of_likelihood(
    moments: Value, samples: Value, misfit: Value, variance: Value, least: Floats
) -> Value:
    """Moments of samples with this misfit, if the noise has to be enlarged by a variance."""
    enlarged = _moments(samples, softmax(misfit * -0.5 / variance, axis=1), least)
    return where(variance > 1.0, enlarged, moments)


def pooled_weights(rounds: list[WeightedRound], of_earlier: Value) -> Value:
    """Weights (1, n) of the points of all rounds, in proportion to effective sample sizes, sum 1.

    The last round keeps its weight even if it had to be tempered: too wide an interval is safer
    than one that rests on a few samples. Weights of the others are multiplied by `of_earlier`.
    """
    parts = []
    for earlier in rounds[:-1]:
        weights, power = earlier.tempered_weights()
        parts.append(weights_by_effective_size(weights, power) * of_earlier)
    parts.append(weights_by_effective_size(rounds[-1].tempered_weights()[0]))
    pooled = concat(parts, axis=1)
    return pooled / pooled.sum(keepdims=True)


def found_at(weighted: WeightedRound) -> ScaledMisfit:
    """The misfits of a round that a mixture has weighed."""
    assert weighted.misfit is not None
    return weighted.misfit


def least_misfit(rounds: list[WeightedRound]) -> Value:
    """The least sum of squared residuals of all points, (1,)."""
    misfits = concat([found_at(r).least for r in rounds], axis=1)
    return misfits.reduce("ReduceMin", keepdims=False).reshape(1)


def excess_variance(misfit: Value, consistency: Consistency, unknowns: int) -> Value:
    r"""Variance of the residuals over that of the noise: 1 if the misfit is within its limit, (1,).

    .. math:: \tau = \chi^2 / q

    beyond the limit, with q unknowns. What no soil explains is an error of the model or of a
    sensor, which neighbouring rows have in common: it does not average out. The error that the
    soil did explain, in q directions, is assumed to be as large as the one that is left.
    """
    one = constant(misfit.graph, np.ones(1))
    return where(misfit > consistency.limit, misfit / float(unknowns), one)


def _prior_round(
    family: WheelFamily, residuals: PolynomialResiduals, draws: ProposalDraws
) -> WeightedRound:
    """The round whose other coordinates are draws of the prior."""
    residual, slope = residuals.at_fixed_points(draws.others)
    ones = np.ones((1, len(draws.t)))
    others = constant(residual.graph, np.concatenate([ones, draws.others[:-1]]))
    mode, precision = gauss_newton(constant(residual.graph, 0.0), residual, slope)
    for _ in range(PRIOR_STEPS - 1):
        mode, precision = residuals.step(concat([others, mode], axis=0), mode)
    return sample_round(residuals, family.axes, others, (mode, precision), draws)


def _mean_basis(residuals: PolynomialResiduals, first: WeightedRound) -> Value:
    """Monomials (terms, 1) of the mean of a round, in standardised coordinates."""
    weights, _ = first.tempered_weights()
    return residuals.basis(gemm(first.points, weights, transpose_b=True))


def _adapted_round(
    family: WheelFamily,
    residuals: PolynomialResiduals,
    mixture: ScaleMixture,
    proposal: Value,
    draws: ProposalDraws,
) -> tuple[Value, WeightedRound]:
    """The unbounded other coordinates (p - 1, n), and the round drawn from them.

    `proposal` (1 + p, n) has 1, the unbounded coordinates, and the solved one by linear regression.
    """
    _, unbounded, mode = proposal.split([1, len(residuals.order) - 1, 1], axis=0)
    bounded = tanh(unbounded)
    log_jacobian = log(maximum(1.0 - bounded * bounded, 1.0 - LARGEST_TANH**2))
    ones = constant(bounded.graph, np.ones((1, len(draws.t))))
    others = concat([ones, bounded], axis=0)
    for _ in range(ADAPTED_STEPS):
        mode, precision = residuals.step(concat([others, within_box(mode)], axis=0), mode)
    current = sample_round(
        residuals, family.axes, others, (mode, precision), draws, log_jacobian, mixture
    )
    return unbounded, current
