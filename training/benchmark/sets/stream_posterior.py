"""The posterior that the memory of an onboard file represents, sampled with many draws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.benchmark.sets.set_unknowns import RankedPosterior, Unknowns, sample_posterior
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.set_posterior.monomials import Terms, monomial_terms, monomials

Floats = NDArray[np.float64]


def response_terms(family: WheelFamily) -> Terms:
    """The monomials of a learned response of the family."""
    return monomial_terms(len(family.axes), family.degree[0], family.targets, family.degree[1])


def posterior_of_memory(
    family: WheelFamily, system: Floats, sets: SimulatedSets, index: int
) -> RankedPosterior:
    r"""The posterior of a linear system (m, terms + errors), as in `SetPosterior`, well sampled.

    .. math:: \log p(y | x) = -\tfrac12 | S^{-1} A b(x) |^2 + const, \qquad I + G G^T = S S^T

    with the last columns G the effects of errors that all readings share. They are integrated out
    by the update of Andrews (AIAA Journal 6(6), 1968), with the Cholesky factor
    :math:`I + G^T G = L L^T`:

    .. math:: A' = A - G (L + I)^{-T} L^{-1} G^T A

    The estimate of a file differs from it
    by the Monte Carlo error of its short sampling alone. Its difference from the exact posterior is
    the error of the learned response, and of a likelihood that is normal in the logarithm of a
    reading.
    """
    these = response_terms(family)
    a, g = np.split(system, [len(these)], axis=1)
    identity = np.eye(g.shape[1])
    factor = np.linalg.cholesky(identity + g.T @ g)
    a = a - g @ np.linalg.solve((factor + identity).T, np.linalg.solve(factor, g.T @ a))

    def log_likelihood(x: Floats) -> Floats:
        return np.asarray(-0.5 * ((monomials(x, these) @ a.T) ** 2).sum(axis=1))

    return sample_posterior(Unknowns.of(family, sets, index), log_likelihood, sets.origin.x[index])[
        0
    ]
