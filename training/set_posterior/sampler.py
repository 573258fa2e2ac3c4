r"""The posterior of a set by adaptive importance sampling, as composites of a graph.

.. math:: \log p(x | y) = \sum_i \lambda_i x_i
    + \log \sum_k w_k \exp\left(-\tfrac12 |A_k b(x)|^2\right) + const

Rows at one operating condition constrain the unknowns to a thin sheet, which points spread over the
whole space would miss. Therefore all unknowns but one are drawn, and that one, the friction angle,
is solved for: Gauss-Newton steps move it onto the sheet, and it is drawn around this conditional
mode with the width of its conditional posterior.

1. In the first round the other unknowns are drawn from the prior, and the model is taken as right:
   it is but a start. Its mean is the soil at which errors are linear.
2. In each adapted round their inverse hyperbolic tangents, which are unbounded, are drawn from a t
   distribution with the mean and covariance of the previous round. These moments are those of the
   highest power of the density that enough samples share. Before the last round, the noise is
   enlarged if no soil explains the readings, and the moments are then those of the first round. The
   friction angle is solved for with the mean of the systems by the evidence of their scales.
3. Rounds are pooled in proportion to their effective sample sizes.

All draws are constants that are shifted and scaled: the same set gives the same answer. A point is
1 and its coordinates within [-1, 1], (1 + p, n), in the order of `Polynomials.order`.

References: Cornuet et al., Scandinavian J. Statistics 39(4), 2012 (adaptive rounds); Robert and
Casella, Monte Carlo Statistical Methods, 2004, chapter 4 (conditioning on one unknown given the
others); Kish, Survey Sampling, 1965 (effective sample size).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import mul

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.value import (
    Value,
    absolute,
    cholesky_columns,
    composite,
    concat,
    constant,
    floor,
    gemm,
    log,
    maximum,
    minimum,
    softmax,
    sqrt,
    tanh,
    where,
)
from training.set_posterior.draws import LARGEST_TANH, ProposalDraws, SampleSizes
from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.monomials import Terms, derivative
from training.set_posterior.scale_mixture import PointMisfit, Scaled

#: Gauss-Newton steps along the solved axis in the prior round, from 0; in adapted rounds there is
#: one, from the regression on the other coordinates, which is closer.
PRIOR_STEPS = 2
#: Its inverse square is added to the curvature along the solved coordinate: it damps the step, and
#: is the width of the proposal, where readings do not constrain the coordinate. A little more than
#: the standard deviation of the uniform prior on [-1, 1], 0.58.
DAMPING_STD = 0.7
#: Added to the variances of a proposal, so that the Cholesky factor of coinciding samples exists.
VARIANCE_FLOOR = 1e-6
#: Standard deviations of the proposal of the solved coordinate over those of its conditional
#: posterior: a proposal somewhat too wide costs samples, one too narrow makes weights unbounded.
PROPOSAL_SCALE = 1.3
#: A distribution is tempered until its 16 largest weights differ by no more than a factor of exp(3)
#: = 20: with fewer samples the moments of the next proposal would rest on a handful of points.
TEMPERING_SAMPLES, TEMPERING_RANGE = 16, 3.0
#: A round counts in full if its power is 1, not at all up to this one, and in proportion between
#: them. Where it counted or did not, rounding moved single answers by 0.24 standard deviations.
LEAST_POWER = 0.9
#: Decrease of the log weight by distance from the box: large against any log likelihood, and
#: finite.
OUTSIDE_PENALTY = 1e9


@dataclass(frozen=True)
class Polynomials:
    """Monomials of the unknowns, and the order in which these are sampled: the last is solved for.

    Torque follows the friction angle almost linearly, so that one Gauss-Newton step comes close.
    """

    terms: Terms
    order: tuple[int, ...]
    tilts: tuple[float, ...]  # lambda of the priors, in that order

    @staticmethod
    def of(axes: Sequence[PriorAxis], terms: Terms) -> Polynomials:
        """Solved for the friction angle if it is unknown."""
        names = [axis.name for axis in axes]
        solved = names.index("friction_angle") if "friction_angle" in names else 0
        order = (*(i for i in range(len(names)) if i != solved), solved)
        return Polynomials(terms, order, tuple(axes[i].tilt for i in order))

    @property
    def unknowns(self) -> int:
        """Number of unknowns that are sampled."""
        return len(self.order)

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows of a point that each monomial multiplies, (terms, factors)."""
        row_of = [0, *(1 + self.order.index(i) for i in range(self.unknowns))]
        return np.asarray([[row_of[k] for k in term] for term in self.terms], np.int64)

    def basis(self, points: Value) -> Value:
        """Monomials (terms, n) at points (1 + p, n)."""

        def body(points: Value) -> list[Value]:
            return [reduce(mul, (points.take(rows, axis=0) for rows in self.rows.T.tolist()))]

        return composite("Monomials", ["monomials"], body, points=points)[0]

    def slope(self, system: Value, basis: Value) -> Value:
        """Derivatives of residuals by the solved coordinate, (m, n)."""
        by_solved = derivative(self.terms, self.order[-1] + 1)
        rows, columns = np.nonzero(by_solved)
        slope = system.take(rows.tolist(), axis=1) * by_solved[rows, columns]
        return slope @ basis.take(columns.tolist(), axis=0)


@dataclass(frozen=True)
class Round:
    """Samples of one round of importance sampling."""

    points: Value  # (1 + p, n) limited to the box
    weights: Value  # (1, n) of a power of the density that several samples share, sum 1
    power: Value  # (1, 1) that power
    misfit: PointMisfit  # by scale of the model's errors


def gauss_newton(
    solved: Value, residual: Value, slope: Value, variance: Value | None = None
) -> tuple[Value, Value]:
    r"""A Gauss-Newton step in one unknown, for n points at once.

    .. math:: \kappa = |r'|^2 + \sigma_0^{-2}, \qquad s \leftarrow s - \frac{r^T r'}{\kappa}

    with r the residuals and r' their derivative (m, n), and the damping :math:`\sigma_0`.
    Steps stay within the box.

    variance: That of the noise (1,) over the one of the residuals, where it is not 1.

    Returns: The new s and the precision kappa of its conditional posterior, (1, n) each.
    """
    square = slope.sum_of_squares(axis=0, keepdims=True)
    gradient = (residual * slope).sum(axis=0, keepdims=True)
    if variance is not None:
        square, gradient = square / variance, gradient / variance
    precision = square + DAMPING_STD**-2
    return (solved - gradient / precision).clip(-1.0, 1.0), precision


def proposed(
    polynomials: Polynomials, solved: Value, precision: Value, t: Value
) -> tuple[Value, Value, Value]:
    r"""The solved coordinate drawn around its conditional mode, and parts of its log weight.

    .. math:: s = \hat s + c \kappa^{-1/2} t, \qquad
        \log w = \underbrace{\sum_i \lambda_i x_i - \tfrac12 |A b(x)|^2}_{\log p(x | y)}
        - \underbrace{\left(\log q(z, t) + \tfrac12 \log \kappa
        - \sum_i \log(1 - x_i^2)\right)}_{\log q(x)}

    up to constants, with t a draw of the t distribution and c the scale of the proposal. The last
    sum is there if the other coordinates are hyperbolic tangents of the draws z.

    Returns: s within the box; its part of the log weight; what is taken off outside the box, (1, n)
    each.
    """
    drawn = solved + PROPOSAL_SCALE * t / sqrt(precision)
    inside = drawn.clip(-1.0, 1.0)
    part = inside * polynomials.tilts[-1] - log(precision) * 0.5
    return inside, part, absolute(drawn - inside) * OUTSIDE_PENALTY


def tempered(boxed: Value, outside: Value) -> tuple[Value, Value]:
    r"""Weights (1, n), sum 1, of the largest power beta <= 1 that several samples share, and beta.

    .. math:: \beta = \min\left(1, \frac{3}{\log w_{(1)} - \log w_{(16)}}\right)

    with the log weights in descending order. Under weights :math:`w^\beta` the 16 best samples
    differ by no more than exp(3).

    boxed: Log weights of the points as limited to the box, (1, n).
    outside: What is taken off them for points outside of it, (1, n).
    """

    def body(boxed: Value, outside: Value) -> list[Value]:
        largest = boxed.largest(TEMPERING_SAMPLES, axis=1)
        first_less_last = largest.take([0], axis=1) - largest.take([TEMPERING_SAMPLES - 1], axis=1)
        power = minimum(TEMPERING_RANGE / first_less_last, 1.0)
        return [softmax((boxed - outside) * power, axis=1), power]

    weights, power = composite(
        "TemperedWeights", ["weights", "power"], body, boxed=boxed, outside=outside
    )
    return weights, power


def first_round(
    polynomials: Polynomials, system: Value, draws: Value, t: Value, log_prior: Value
) -> list[Value]:
    """The round of draws of the prior, for residuals (m, terms) of a model without errors.

    draws: Unbounded other coordinates (p - 1, n).
    t, log_prior: Draws for the solved coordinate, and the log of prior over proposal, (1, n).

    Returns: Monomials (terms, 1) of the mean; of each point the solved coordinate, its log weight
    without the readings, and what is taken off outside the box, (1, n) each.
    """
    others, ones = tanh(draws), t * 0.0 + 1.0
    solved = t * 0.0
    for _ in range(PRIOR_STEPS):
        basis = polynomials.basis(concat([ones, others, solved], axis=0))
        slope = polynomials.slope(system, basis)
        solved, precision = gauss_newton(solved, system @ basis, slope)
    solved, part, outside = proposed(polynomials, solved, precision, t)
    points = concat([ones, others, solved], axis=0)
    residuals, free = system @ polynomials.basis(points), log_prior + part
    weights, _ = tempered(free - residuals.sum_of_squares(axis=0, keepdims=True) * 0.5, outside)
    return [polynomials.basis(gemm(points, weights, transpose_b=True)), solved, free, outside]


def adapted_round(
    polynomials: Polynomials,
    mixture: Scaled,
    moments: Value,
    system: Value,
    draws: ProposalDraws,
    variance: Value,
) -> tuple[Value, Round]:
    """Samples (1 + p, n) as 1 and their unbounded coordinates, and the round drawn from them.

    moments: Second moments (1 + p, 1 + p) of the samples of the round before.
    system: For the Gauss-Newton step, (m, terms).
    variance: Of the noise over the one that was given, (1,).
    """

    def body(
        moments: Value, systems: Value, log_weight: Value, system: Value, variance: Value,
        normal: Value, t: Value, log_density: Value,
    ) -> list[Value]:  # fmt: skip
        points = cholesky_columns(moments, polynomials.unknowns) @ normal
        _, unbounded, mode = points.split([1, polynomials.unknowns - 1, 1], axis=0)
        ones = t * 0.0 + 1.0  # the first row is this but for rounding
        bounded = tanh(unbounded)
        jacobian = log(maximum(1.0 - bounded * bounded, 1.0 - LARGEST_TANH**2))
        basis = polynomials.basis(concat([ones, bounded, mode.clip(-1.0, 1.0)], axis=0))
        slope = polynomials.slope(system, basis)
        mode, precision = gauss_newton(mode, system @ basis, slope, variance)
        solved, part, outside = proposed(polynomials, mode, precision, t)
        points = concat([ones, bounded, solved], axis=0)
        found = Scaled(systems, log_weight).misfit(polynomials.basis(points), variance)
        tilted = constant(points.graph, [[0.0, *polynomials.tilts[:-1], 0.0]]) @ points
        boxed = part + tilted + found.log_likelihood + jacobian.sum(axis=0, keepdims=True)
        weights, power = tempered(boxed - log_density, outside)
        samples = concat([ones, unbounded, solved], axis=0)
        return [samples, points, weights, power, *found]

    names = ["samples", "points", "weights", "power", *PointMisfit._fields]
    samples, points, weights, power, *found = composite(
        "AdaptedRound", names, body, moments=moments, systems=mixture.systems,
        log_weight=mixture.log_weight, system=system, variance=variance, **draws._asdict(),
    )  # fmt: skip
    return samples, Round(points, weights, power, PointMisfit(*found))


def adapted_rounds(
    polynomials: Polynomials,
    mixture: Scaled,
    limit: Value,
    targets: int,
    sizes: SampleSizes,
    first: tuple[Value, Value, Value, Value],
    draws: ProposalDraws,
) -> list[Value]:
    r"""Points (1 + p, n), weights (1, n) and least misfit (1,) of all rounds.

    Beyond its limit, the variance of the residuals over that of the noise is :math:`\chi^2 / q`
    with q unknowns. What no soil explains is an error of the model or of a sensor, which
    neighbouring rows have in common: it does not average out. The error that the soil did explain,
    in q directions, is assumed to be as large as the one that is left.

    limit: Largest misfit of sound sets, (1,).
    targets: Number q of estimated unknowns.
    first: Draws of the prior (p - 1, n), and of each point the solved coordinate, its log weight
        without the readings, and what is taken off outside the box.
    """
    unbounded, solved, free, outside = first
    one = limit * 0.0 + 1.0
    ones = solved * 0.0 + 1.0
    points = concat([ones, tanh(unbounded), solved], axis=0)
    misfit = mixture.misfit(polynomials.basis(points), one)
    rounds = [Round(points, *tempered(free + misfit.log_likelihood, outside), misfit)]
    samples = concat([ones, unbounded, solved], axis=0)
    floors = np.diag([0.0, *[VARIANCE_FLOOR] * polynomials.unknowns])
    enough, variance = samples, one
    for number in range(sizes.rounds):
        last = rounds[-1]
        moments = gemm(samples * last.weights, samples, floors, transpose_b=True)
        system = mixture.mean(last.misfit, last.weights)
        if number == sizes.rounds - 1:
            before = least_misfit(rounds)
            variance = where(before > limit, before / float(targets), one)
            enlarged = softmax(rounds[0].misfit.least * (-0.5 / variance), axis=1)
            again = gemm(enough * enlarged, enough, floors, transpose_b=True)
            moments = where(variance > 1.0, again, moments)
        samples, current = adapted_round(polynomials, mixture, moments, system, draws, variance)
        rounds.append(current)
    least = minimum(before, least_misfit(rounds[-1:]))
    # the rounds before the last are samples of the posterior with the noise as it was given
    weights = pooled_weights(rounds, floor(1.0 / variance))
    return [concat([r.points for r in rounds], axis=1), weights, least]


def least_misfit(rounds: Sequence[Round]) -> Value:
    """The least sum of squared residuals of all points, (1,)."""
    found = [r.misfit.least.reduce("ReduceMin", axis=1, keepdims=False) for r in rounds]
    return reduce(minimum, found)


def pooled_weights(rounds: Sequence[Round], of_earlier: Value) -> Value:
    r"""Weights (1, n) of the points of all rounds, in proportion to effective sample sizes, sum 1.

    .. math:: n_{eff} = \frac{1}{\sum_i w_i^2}

    (Kish). A round that had to be tempered (a power up to `LEAST_POWER`) gets the weight 0: its
    samples are those of another distribution. The last round keeps its weight even then: too wide
    an interval is safer than one that rests on a few samples. Weights of the others are multiplied
    by `of_earlier`.
    """
    effective = [1.0 / r.weights.sum_of_squares(axis=1, keepdims=True) for r in rounds]
    shares = []
    for r, size in zip(rounds[:-1], effective, strict=False):
        counted = ((r.power - LEAST_POWER) / (1.0 - LEAST_POWER)).clip(0.0, 1.0)
        shares.append(counted * of_earlier * size)
    shares.append(effective[-1])
    total = shares[0].node("Sum", *shares[1:])
    own = [r.weights * (share / total) for r, share in zip(rounds, shares, strict=True)]
    return concat(own, axis=1)
