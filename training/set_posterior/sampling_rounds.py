"""One round of importance sampling: its fixed quasi-random draws, and the weights of its samples.

The draws are constants of the graph, so that the same set always gets the same estimate. Points of
Sobol sequences cover the space more evenly than random ones: moments of smooth posteriors converge
faster (Owen, Monte Carlo theory, methods and examples, chapter 15).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, qmc
from scipy.stats import t as student_t

from soilml.arrays import Floats
from training.onnx_graph.value import (
    Value,
    absolute,
    concat,
    constant,
    gemm,
    log,
    minimum,
    softmax,
    sqrt,
)
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.polynomial_residuals import within_box
from training.set_posterior.scale_mixture import PointMisfit

#: Degrees of freedom of the t distributions: tails heavier than those of a normal distribution keep
#: the importance weights bounded where the posterior has heavier tails than its normal
#: approximation, and the variance is finite.
DEGREES_OF_FREEDOM = 6.0
#: Seeds of the scrambled Sobol sequences; the released files depend on them.
PRIOR_SEED, ADAPTED_SEED = 3, 4


@dataclass(frozen=True)
class SampleSizes:
    """Samples of the prior round and of each adapted round, and the number of adapted rounds."""

    prior: int
    adapted: int
    rounds: int


#: Up to this many unknowns the smaller sizes apply: posterior means are then off by 0.1 of a
#: standard deviation (root mean square).
FEW_UNKNOWNS = 3
SIZES_FEW, SIZES_MANY = SampleSizes(256, 128, 2), SampleSizes(512, 256, 3)
#: Those of a file for a microcontroller, whatever the number of unknowns.
SIZES_SMALL = SampleSizes(64, 48, 2)


@dataclass(frozen=True)
class ProposalDraws:
    """Fixed draws of one round.

    `others` are draws for all unknowns but the solved one; `t` (n,) standard t draws for the solved
    one; `log_density` (1, n) the logarithm of the density of both, up to a constant.
    """

    others: Floats
    t: Floats
    log_density: Floats


def sample_sizes(unknowns: int) -> SampleSizes:
    """Sizes of the rounds by the number of unknowns."""
    return SIZES_FEW if unknowns <= FEW_UNKNOWNS else SIZES_MANY


def prior_draws(family: WheelFamily, order: tuple[int, ...], count: int) -> ProposalDraws:
    """Draws of the prior: `others` are coordinates (p, n) in an order of the axes, the last 0.

    Nearly known axes are in units of `NORMAL_TRUNCATION` of their standard deviations, and
    truncated.
    """
    u = qmc.Sobol(len(order), rng=PRIOR_SEED).random(count)
    points, log_density = np.zeros((len(order), count)), np.zeros((1, count))
    for row, axis in enumerate(order[:-1]):
        if axis < family.free:
            points[row] = family.axes[axis].quantile(u[:, row])
            log_density += family.axes[axis].tilt * points[row]
        else:
            points[row] = np.clip(ndtri(u[:, row]) / NORMAL_TRUNCATION, -1.0, 1.0)
            log_density -= 0.5 * (NORMAL_TRUNCATION * points[row]) ** 2
    t = student_t.ppf(u[:, -1], DEGREES_OF_FREEDOM)
    return ProposalDraws(points, t, log_density + student_t.logpdf(t, DEGREES_OF_FREEDOM)[None])


def adapted_draws(unknowns: int, count: int) -> ProposalDraws:
    r"""Draws of a standard t distribution: `others` are (p, n), the first row 1.

    A multivariate t variable of p - 1 dimensions with nu degrees of freedom is a normal one times
    the square root of nu over a chi-squared variable; its log density is, up to a constant,

    .. math:: -\tfrac12 (\nu + p - 1) \log\left(1 + |z|^2 / \nu\right)

    The row of ones adds the mean when a Cholesky factor of moments is multiplied with the draws.
    """
    u = qmc.Sobol(unknowns + 1, rng=ADAPTED_SEED).random(1 << (count - 1).bit_length())[:count]
    stretch = np.sqrt(DEGREES_OF_FREEDOM / chi2.ppf(u[:, unknowns], DEGREES_OF_FREEDOM))
    z = ndtri(u[:, : unknowns - 1]) * stretch[:, None]
    squares = (z**2).sum(axis=1)
    log_density = (
        -0.5 * (DEGREES_OF_FREEDOM + unknowns - 1.0) * np.log1p(squares / DEGREES_OF_FREEDOM)
    )
    t = student_t.ppf(u[:, unknowns - 1], DEGREES_OF_FREEDOM)
    return ProposalDraws(
        np.concatenate([np.ones((count, 1)), z], axis=1).T,
        t,
        log_density[None] + student_t.logpdf(t, DEGREES_OF_FREEDOM)[None],
    )


#: Standard deviations of the proposal of the solved coordinate over those of its conditional
#: posterior: a proposal somewhat too wide costs samples, one too narrow makes weights unbounded.
PROPOSAL_SCALE = 1.3
#: A distribution is tempered until its 16 largest weights differ by no more than a factor of exp(3)
#: = 20: with fewer samples the moments of the next proposal would rest on a handful of points.
TEMPERING_SAMPLES, TEMPERING_RANGE = 16, 3.0
#: Decrease of the log weight by distance from the box: large against any log likelihood, and
#: finite.
OUTSIDE_PENALTY = 1e9


@dataclass(frozen=True)
class WeightedRound:
    """Samples of one round of importance sampling."""

    points: Value  # (1 + p, n) limited to the box
    solved: Value  # (1, n) their last coordinate
    boxed_log_weight: Value  # (1, n) of the points as limited to the box
    log_weight: Value  # (1, n) vanishing weight for samples outside of the box
    misfit: PointMisfit  # by scale of the model's errors

    def tempered_weights(self) -> tuple[Value, Value]:
        """Weights (1, n) of a power of the density that several samples share, and that power."""
        power = tempering_power(self.boxed_log_weight)
        return tempered_weights(self.log_weight, power), power


def sample_round(
    tilts: Sequence[float],
    others: Sequence[Value],
    solved: tuple[Value, Value],
    draws: ProposalDraws,
    misfit_at: Callable[[Value, Value], PointMisfit],
    log_jacobian: Value | None = None,
) -> WeightedRound:
    r"""Draw the solved coordinate around its conditional mode, and weigh the samples.

    .. math:: s = \hat s + c \kappa^{-1/2} t, \qquad
        \log w = \underbrace{\sum_i \lambda_i x_i - \tfrac12 |A b(x)|^2}_{\log p(x | y)}
        - \underbrace{\left(\log q(z, t) + \tfrac12 \log \kappa
        - \sum_i \log(1 - x_i^2)\right)}_{\log q(x)}

    up to constants, with t a draw of the t distribution and c the scale of the proposal. The last
    sum is there if the other coordinates are hyperbolic tangents of the draws z.

    tilts: The lambda of the prior of each coordinate, in their order.
    others: 1, and the other coordinates, within the box: rows that make up (p, n).
    solved: Mode and precision of the solved coordinate given the others, (1, n) each.
    draws: The draws t of the round, and the log density of all draws.
    misfit_at: The likelihood of points (1 + p, n), whose last coordinate is (1, n).
    log_jacobian: log(1 - x_i^2) of the other coordinates (p - 1, n).
    """
    mode, precision = solved
    proposed = mode + PROPOSAL_SCALE * draws.t[None] / sqrt(precision)
    inside = within_box(proposed)
    points = concat([*others, inside], axis=0)
    misfit = misfit_at(points, inside)
    distance = absolute(proposed - inside)
    # one matrix product adds up the parts of the log weight, with these coefficients
    parts = [
        (points, [0.0, *tilts]),
        (log(precision), [-0.5]),
        (misfit.log_likelihood, [1.0 / misfit.multiple]),
    ]
    if log_jacobian is not None:
        parts.append((log_jacobian, [1.0] * (len(tilts) - 1)))
    stacked = concat([*[part for part, _ in parts], distance], axis=0)
    coefficients = [coefficient for _, of_part in parts for coefficient in of_part]
    both = gemm(
        constant(mode.graph, [[*coefficients, 0.0], [*coefficients, -OUTSIDE_PENALTY]]),
        stacked,
        -draws.log_density,
    )
    boxed_log_weight, log_weight = both.split(2, axis=0)
    return WeightedRound(points, inside, boxed_log_weight, log_weight, misfit)


def tempering_power(log_weight: Value) -> Value:
    r"""The largest power beta <= 1 of the density that several samples share, (1, 1).

    .. math:: \beta = \min\left(1, \frac{3}{\log w_{(1)} - \log w_{(16)}}\right)

    with the log weights in descending order. Under weights :math:`w^\beta` the 16 best samples
    differ by no more than exp(3).
    """
    largest = log_weight.largest(TEMPERING_SAMPLES, axis=1)
    first_less_last = np.eye(TEMPERING_SAMPLES)[:, :1] - np.eye(TEMPERING_SAMPLES)[:, -1:]
    log_range = largest @ constant(log_weight.graph, first_less_last)
    return minimum(TEMPERING_RANGE / log_range, 1.0)


def tempered_weights(log_weight: Value, power: Value) -> Value:
    """Weights (1, n) of a power of the density, which sum to 1."""
    return softmax(log_weight * power, axis=1)
