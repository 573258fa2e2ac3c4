"""The posterior of a set by adaptive importance sampling, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.onnx_graph.cholesky import cholesky_columns
from training.onnx_graph.value import Value, concat, constant, gemm, log, maximum, tanh
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.response_surface import Response
from training.set_posterior.sampler.importance_weights import (
    WeightedRound,
    sample_round,
    tempered_weights,
    tempering_power,
    weights_by_effective_size,
)
from training.set_posterior.sampler.polynomial_residuals import (
    PolynomialResiduals,
    gauss_newton,
    standardised_system,
)
from training.set_posterior.sampler.proposals import (
    ProposalDraws,
    adapted_draws,
    prior_draws,
    sample_sizes,
)

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
    family: WheelFamily, response: Response, context: ContextValues, system: Value
) -> WeightedSample:
    r"""Weighted samples of the posterior of a system (m, terms) of residuals.

    .. math:: \log p(x | y) = \sum_i \lambda_i x_i - \tfrac12 |A b(x)|^2 + const

    Rows at one operating condition constrain the unknowns to a thin sheet, which points spread over
    the whole space would miss. Therefore all unknowns but one are drawn, and that one, the friction
    angle, is solved for: Gauss-Newton steps move it onto the sheet, and it is drawn around this
    conditional mode with the width of its conditional posterior.

    1. In the first round the other unknowns are drawn from the prior.
    2. In each adapted round their inverse hyperbolic tangents, which are unbounded, are drawn from
       a t distribution with the mean and covariance of the previous round. These moments are those
       of the highest power of the density that enough samples share (`tempering_power`).
    3. Rounds are pooled in proportion to their effective sample sizes.

    All draws are constants of the graph that are shifted and scaled: the same set gives the same
    answer.

    Parameters
    ----------
    family, response : WheelFamily, Response
        Axes with their priors, and the monomials of the system.
    context : ContextValues
        Standard deviations of nearly known axes.
    system : Value
        Residuals (m, terms) with the bias of the torque sensor integrated out.

    References
    ----------
    Cornuet et al., Scandinavian J. Statistics 39(4), 2012 (adaptive rounds); Robert and Casella,
    Monte Carlo Statistical Methods, 2004, chapter 4 (conditioning on one unknown given the others);
    Kish, Survey Sampling, 1965 (effective sample size).
    """
    graph, unknowns = system.graph, len(family.axes)
    sizes = sample_sizes(unknowns)
    residuals = PolynomialResiduals.of(
        family, response, standardised_system(family, response, context, system)
    )
    variance_floor = constant(graph, np.diag([0.0, *[VARIANCE_FLOOR] * unknowns]))
    draws = adapted_draws(unknowns, sizes.adapted)
    prior = prior_draws(family, residuals.order, sizes.prior)
    current = _prior_round(family, residuals, prior)
    bounded = np.clip(prior.others[:-1], -LARGEST_TANH, LARGEST_TANH)
    unbounded = constant(graph, np.arctanh(bounded))
    count, rounds, pooled_weights = sizes.prior, [current], []
    for _ in range(sizes.rounds):
        power = tempering_power(current.boxed_log_weight)
        weights = tempered_weights(current.log_weight, power)
        pooled_weights.append(weights_by_effective_size(weights, power))
        solved = current.points.take([unknowns], axis=0)
        samples = concat([constant(graph, np.ones((1, count))), unbounded, solved], axis=0)
        moments = gemm(samples * weights, samples, variance_floor, transpose_b=True)
        proposal = cholesky_columns(moments, unknowns) @ draws.others
        unbounded, current = _adapted_round(family, residuals, proposal, draws)
        count = sizes.adapted
        rounds.append(current)
    # The last round keeps its weight even if it had to be tempered: too wide an interval is safer
    # than one that rests on a few samples.
    power = tempering_power(current.boxed_log_weight)
    weights = tempered_weights(current.log_weight, power)
    pooled_weights.append(weights_by_effective_size(weights))
    pooled = concat(pooled_weights, axis=1)
    points = concat([r.points for r in rounds], axis=1)
    normalised = pooled / pooled.sum(keepdims=True)
    misfits = concat([r.misfit for r in rounds], axis=1)
    return WeightedSample(
        points,
        normalised,
        misfits.reduce("ReduceMin", keepdims=False).reshape(1),
        sizes.prior + sizes.rounds * sizes.adapted,
        residuals.order,
    )


def _prior_round(
    family: WheelFamily, residuals: PolynomialResiduals, draws: ProposalDraws
) -> WeightedRound:
    """The round whose other coordinates are draws of the prior."""
    residual, slope = residuals.at_fixed_points(draws.others)
    others = constant(residual.graph, draws.others[:-1])
    mode, precision = gauss_newton(constant(residual.graph, 0.0), residual, slope)
    for _ in range(PRIOR_STEPS - 1):
        mode, precision = residuals.step(others, mode, len(draws.t))
    return sample_round(residuals, family.axes, others, (mode, precision), draws)


def _adapted_round(
    family: WheelFamily, residuals: PolynomialResiduals, proposal: Value, draws: ProposalDraws
) -> tuple[Value, WeightedRound]:
    """The unbounded other coordinates (p - 1, n), and the round drawn from them.

    `proposal` (1 + p, n) has 1, the unbounded coordinates, and the solved one by linear regression.
    """
    _, unbounded, mode = proposal.split([1, len(residuals.order) - 1, 1], axis=0)
    others = tanh(unbounded)
    log_jacobian = log(maximum(1.0 - others * others, 1.0 - LARGEST_TANH**2))
    for _ in range(ADAPTED_STEPS):
        mode, precision = residuals.step(others, mode, len(draws.t))
    solved = (mode, precision)
    return unbounded, sample_round(residuals, family.axes, others, solved, draws, log_jacobian)
