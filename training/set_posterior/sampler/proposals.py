"""The fixed quasi-random numbers from which the samples of a set posterior are computed.

They are constants of the graph, so that the same set always gets the same estimate. Points of Sobol
sequences cover the space more evenly than random ones: moments of smooth posteriors converge faster
(Owen, Monte Carlo theory, methods and examples, chapter 15).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import chi2, qmc
from scipy.stats import t as student_t

from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import WheelFamily

Floats = NDArray[np.float64]

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
    u = qmc.Sobol(unknowns + 1, rng=ADAPTED_SEED).random(count)
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
