"""Fixed quasi-random draws of the rounds of importance sampling.

The draws are constants of the graph, so that the same set always gets the same estimate. Points of
Sobol sequences cover the space more evenly than random ones: moments of smooth posteriors converge
faster (Owen, Monte Carlo theory, methods and examples, chapter 15).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, qmc
from scipy.stats import t as student_t

from soilml.arrays import Floats
from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value, constant
from training.set_posterior.families.coordinates import PriorAxis

#: Degrees of freedom of the t distributions: tails heavier than those of a normal distribution keep
#: the importance weights bounded where the posterior has heavier tails than its normal
#: approximation, and the variance is finite.
DEGREES_OF_FREEDOM = 6.0
#: Seeds of the scrambled Sobol sequences; the released files depend on them.
PRIOR_SEED, ADAPTED_SEED = 3, 4
#: Coordinates are drawn as hyperbolic tangents, up to this one: closer to 1, float32 loses 1 - x^2.
LARGEST_TANH = 1.0 - 1e-6


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


class ProposalDraws(NamedTuple):
    """Fixed draws of one round.

    `normal` are draws (p, n) for all unknowns but the solved one, with 1 in the first row, or
    (p - 1, n) of the prior; `t` (1, n) standard t draws for the solved one; `log_density` (1, n)
    the logarithm of the density of both, up to a constant.
    """

    normal: Value
    t: Value
    log_density: Value


def prior_draws(
    graph: Graph, axes: Sequence[PriorAxis], order: tuple[int, ...], count: int
) -> ProposalDraws:
    """Draws of the prior, as inverse hyperbolic tangents, and the log of prior over proposal."""
    u = qmc.Sobol(len(order), rng=PRIOR_SEED).random(count)
    t = student_t.ppf(u[:, -1], DEGREES_OF_FREEDOM)
    log_density = -student_t.logpdf(t, DEGREES_OF_FREEDOM)[None]  # the prior cancels out
    points = np.stack([axes[axis].quantile(u[:, row]) for row, axis in enumerate(order[:-1])])
    unbounded = np.arctanh(np.clip(points, -LARGEST_TANH, LARGEST_TANH))
    return _constants(graph, "prior", unbounded, t, log_density)


def adapted_draws(graph: Graph, unknowns: int, count: int) -> ProposalDraws:
    r"""Draws of a standard t distribution of p - 1 dimensions.

    A multivariate t variable with nu degrees of freedom is a normal one times the square root of nu
    over a chi-squared variable; its log density is, up to a constant,

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
    normal = np.concatenate([np.ones((count, 1)), z], axis=1).T
    both = log_density[None] + student_t.logpdf(t, DEGREES_OF_FREEDOM)[None]
    return _constants(graph, "adapted", normal, t, both)


def _constants(
    graph: Graph, name: str, normal: Floats, t: Floats, log_density: Floats
) -> ProposalDraws:
    parts = {"draws": normal, "t": t[None], "log_density": log_density}
    return ProposalDraws(*(constant(graph, v, name=f"{name}_{k}") for k, v in parts.items()))
