"""The posterior of a set by adaptive importance sampling, as nodes of a graph."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    shortcuts,
    softmax,
    tanh,
    where,
)
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.likelihood import Likelihood
from training.set_posterior.misfit_test import Consistency
from training.set_posterior.polynomial_residuals import (
    NearlyKnown,
    PolynomialResiduals,
    ResidualsAtFixedPoints,
    order_of_axes,
    within_box,
)
from training.set_posterior.sampling_rounds import (
    ProposalDraws,
    SampleSizes,
    WeightedRound,
    adapted_draws,
    prior_draws,
    sample_round,
)
from training.set_posterior.scale_mixture import OneSystem, PointMisfit, ScaleMixture
from training.set_posterior.small_likelihood import SmallLikelihood

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


@dataclass(frozen=True)
class FirstRound:
    """What the adapted rounds begin with."""

    likelihood: Likelihood | SmallLikelihood
    nearly_known: NearlyKnown | None
    limit: Value  # (1,) largest misfit of sound sets
    residuals: PolynomialResiduals
    along_solved: ResidualsAtFixedPoints
    samples: WeightedRound


def add_importance_sampler(
    likelihood: Likelihood | SmallLikelihood,
    consistency: Consistency,
    sizes: SampleSizes,
    grown: str,
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
    answer. Readings that do have noise alone need no errors to be integrated out in the rounds.

    likelihood: Of the readings, and the unknowns with their priors.
    consistency: Limits of the set's misfit.
    sizes: Points of each round.
    grown: Name of the output for the state with the new rows.

    References: Cornuet et al., Scandinavian J. Statistics 39(4), 2012 (adaptive rounds); Robert and
    Casella, Monte Carlo Statistical Methods, 2004, chapter 4 (conditioning on one unknown given the
    others); Kish, Survey Sampling, 1965 (effective sample size).
    """
    family = likelihood.family
    nearly_known = NearlyKnown.of(family, likelihood.response, likelihood.context)
    given = likelihood, nearly_known, consistency.limit
    with_errors = partial(_with_errors, sizes)
    if likelihood.noise_alone is None:
        state, points, weights, misfit = with_errors(*given)
        state.node("Identity").named(grown)
    else:
        state, points, weights, misfit = shortcuts(
            likelihood.noise_alone, partial(_with_noise_alone, sizes), with_errors, *given
        )
        state.named(grown)
    count = sizes.prior + sizes.rounds * sizes.adapted
    return WeightedSample(points, weights, misfit, count, order_of_axes(family))


def _first_round(
    sizes: SampleSizes,
    likelihood: Likelihood | SmallLikelihood,
    nearly_known: NearlyKnown | None,
    limit: Value,
    start: Value,
) -> FirstRound:
    """The round of draws of the prior, for residuals `start` (m, terms)."""
    family = likelihood.family
    residuals = PolynomialResiduals.of(family, likelihood.response, nearly_known, start)
    draws = prior_draws(family, residuals.order, sizes.prior)
    along_solved = ResidualsAtFixedPoints.of(residuals, draws.others[:-1])
    samples = _prior_round(family, residuals.order, along_solved, draws)
    return FirstRound(likelihood, nearly_known, limit, residuals, along_solved, samples)


def _with_errors(
    sizes: SampleSizes,
    likelihood: Likelihood | SmallLikelihood,
    nearly_known: NearlyKnown | None,
    limit: Value,
) -> list[Value]:
    """The state with new rows, points, weights and misfit, errors linear at the first mean."""
    first = _first_round(sizes, likelihood, nearly_known, limit, likelihood.start())
    samples = first.samples
    weights, _ = samples.tempered_weights()
    soil = first.residuals.basis(gemm(samples.points, weights, transpose_b=True))
    if nearly_known is not None:
        soil = soil * nearly_known.factors.node("Transpose")
    mixture, state = likelihood.mixture_at(soil)
    mixture = mixture.standardised(nearly_known)
    misfit = mixture.misfit(first.along_solved.basis(samples.solved))
    change = samples.misfit.least * 0.5 + misfit.log_likelihood
    samples = replace(
        samples,
        boxed_log_weight=samples.boxed_log_weight + change,
        log_weight=samples.log_weight + change,
        misfit=misfit,
    )
    return [state, *_adapted_rounds(sizes, replace(first, samples=samples), mixture)]


def _with_noise_alone(
    sizes: SampleSizes, likelihood: Likelihood, nearly_known: NearlyKnown | None, limit: Value
) -> list[Value]:
    """The same of readings that have noise alone."""
    rows = likelihood.rows_of_noise_alone()
    first = _first_round(sizes, likelihood, nearly_known, limit, likelihood.with_noise_alone(rows))
    state = likelihood.grown(rows)
    return [state, *_adapted_rounds(sizes, first, OneSystem(first.residuals.system))]


def _adapted_rounds(
    sizes: SampleSizes, first: FirstRound, posterior: OneSystem | ScaleMixture
) -> list[Value]:
    """Points (1 + p, n), weights (1, n) and least misfit (1,) of all rounds."""
    family, residuals, limit = first.likelihood.family, first.residuals, first.limit
    unknowns = len(family.axes)
    draws = adapted_draws(unknowns, sizes.adapted)
    least = np.diag([0.0, *[VARIANCE_FLOOR] * unknowns])
    rounds, samples = [first.samples], _prior_samples(family, residuals, sizes, first.samples)
    first_samples, variance = samples, None
    for number in range(sizes.rounds):
        weights = rounds[-1].tempered_weights()[0]
        moments = _moments(samples, weights, least)
        residuals = posterior.proposal(residuals, rounds[-1].misfit, weights)
        if number == sizes.rounds - 1:
            least_before = least_misfit(rounds)
            variance = excess_variance(least_before, limit, family.targets)
            enlarged = softmax(first.samples.misfit.least * (-0.5 / variance), axis=1)
            again = _moments(first_samples, enlarged, least)
            moments = where(variance > 1.0, again, moments)
        points = cholesky_columns(moments, unknowns) @ draws.others
        samples, current = _adapted_round(family, residuals, posterior, points, draws, variance)
        rounds.append(current)
    assert variance is not None
    misfit = minimum(least_before, least_misfit(rounds[-1:]))
    # the rounds before the last are samples of the posterior with the noise as it was given
    weights = pooled_weights(rounds, sizes, floor(1.0 / variance))
    return [concat([r.points for r in rounds], axis=1), weights, misfit]


def _prior_samples(
    family: WheelFamily, residuals: PolynomialResiduals, sizes: SampleSizes, first: WeightedRound
) -> Value:
    """1, the unbounded other coordinates and the solved one (1 + p, n) of the prior round."""
    others = prior_draws(family, residuals.order, sizes.prior).others[:-1]
    unbounded = np.arctanh(np.clip(others, -LARGEST_TANH, LARGEST_TANH))
    drawn = np.concatenate([np.ones((1, sizes.prior)), unbounded])
    return concat([constant(first.solved.graph, drawn), first.solved], axis=0)


def _moments(samples: Value, weights: Value, floor: Floats) -> Value:
    """Second moments (1 + p, 1 + p) of weighted samples, with their least variances added."""
    return gemm(samples * weights, samples, floor, transpose_b=True)


def pooled_weights(rounds: Sequence[WeightedRound], sizes: SampleSizes, of_earlier: Value) -> Value:
    r"""Weights (1, n) of the points of all rounds, in proportion to effective sample sizes, sum 1.

    .. math:: n_{eff} = \frac{1}{\sum_i w_i^2}

    (Kish). A round that had to be tempered (power below 1) gets the weight 0: its samples are those
    of another distribution. The last round keeps its weight even if it had to be tempered: too wide
    an interval is safer than one that rests on a few samples. Weights of the others are multiplied
    by `of_earlier`.

    All rounds are treated at once, as rows of as many points as divide the sizes of all.
    """
    weights, powers = zip(*(r.tempered_weights() for r in rounds), strict=True)
    unit = math.gcd(sizes.prior, sizes.adapted)
    rows = [sizes.prior // unit, *[sizes.adapted // unit] * sizes.rounds]
    round_of_row = np.repeat(np.arange(len(rounds)), rows)
    own = concat(weights, axis=1).reshape(-1, unit)
    same_round = (round_of_row[:, None] == round_of_row).astype(float)
    # (rows, 1), of the whole round
    squares: Value = same_round @ own.sum_of_squares(axis=1, keepdims=True)
    earlier = [powers[k] for k in round_of_row if k < len(rounds) - 1]
    last = constant(of_earlier.graph, np.ones((rows[-1], 1)))
    used = concat([floor(concat(earlier, axis=0)) * of_earlier, last], axis=0)
    effective = used / squares
    total: Value = (1.0 / same_round.sum(axis=0))[None] @ effective
    return (own * (effective / total)).reshape(1, -1)


def least_misfit(rounds: Sequence[WeightedRound]) -> Value:
    """The least sum of squared residuals of all points, (1,)."""
    first, *others = (r.misfit.least for r in rounds)
    misfits = concat([first, *others], axis=1) if others else first
    return misfits.reduce("ReduceMin", axis=1, keepdims=False)


def excess_variance(misfit: Value, limit: Value, unknowns: int) -> Value:
    r"""Variance of the residuals over that of the noise: 1 if the misfit is within its limit, (1,).

    .. math:: \tau = \chi^2 / q

    beyond the limit, with q unknowns. What no soil explains is an error of the model or of a
    sensor, which neighbouring rows have in common: it does not average out. The error that the
    soil did explain, in q directions, is assumed to be as large as the one that is left.
    """
    one = constant(misfit.graph, np.ones(1))
    return where(misfit > limit, misfit / float(unknowns), one)


def _prior_round(
    family: WheelFamily,
    order: tuple[int, ...],
    along_solved: ResidualsAtFixedPoints,
    draws: ProposalDraws,
) -> WeightedRound:
    """The round whose other coordinates are draws of the prior."""
    ones = np.ones((1, len(draws.t)))
    graph = along_solved.higher.graph
    others = constant(graph, np.concatenate([ones, draws.others[:-1]]))

    def misfit_at(_: Value, solved: Value) -> PointMisfit:
        return PointMisfit.of_noise_alone(along_solved.residuals(solved))

    tilts = [family.axes[i].tilt for i in order]
    return sample_round(tilts, [others], along_solved.steps(PRIOR_STEPS), draws, misfit_at)


def _adapted_round(
    family: WheelFamily,
    residuals: PolynomialResiduals,
    posterior: OneSystem | ScaleMixture,
    proposal: Value,
    draws: ProposalDraws,
    variance: Value | None,
) -> tuple[Value, WeightedRound]:
    """Samples (1 + p, n) as 1 and their unbounded coordinates, and the round drawn from them.

    `proposal` (1 + p, n) has 1, the unbounded coordinates, and the solved one by linear regression;
    `variance` (1,) is that of the noise over the one that was given, where it may be another.
    """
    _, unbounded, mode = proposal.split([1, len(residuals.order) - 1, 1], axis=0)
    bounded = tanh(unbounded)
    log_jacobian = log(maximum(1.0 - bounded * bounded, 1.0 - LARGEST_TANH**2))
    ones = constant(bounded.graph, np.ones((1, len(draws.t))))
    for _ in range(ADAPTED_STEPS):
        points = concat([ones, bounded, within_box(mode)], axis=0)
        mode, precision = residuals.step(points, mode, variance)

    def misfit_at(points: Value, _: Value) -> PointMisfit:
        return posterior.misfit(residuals.basis(points), variance)

    tilts = [family.axes[i].tilt for i in residuals.order]
    others, solved = [ones, bounded], (mode, precision)
    current = sample_round(tilts, others, solved, draws, misfit_at, log_jacobian)
    return concat([ones, unbounded, current.solved], axis=0), current
