"""The posterior that a file on board stands for, from the memory that its readings leave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.benchmark.sets.posterior_summary import ExactSetPosterior, Unknowns, posterior
from training.set_posterior.monomials import Terms, monomials, terms
from training.set_posterior.wheel_family import SimulatedSets, WheelFamily

Floats = NDArray[np.float64]


def terms_of(family: WheelFamily) -> Terms:
    """The monomials that a response of the family has."""
    return terms(len(family.axes), family.degree[0], family.targets, family.degree[1])


def posterior_of_memory(
    family: WheelFamily, system: Floats, sets: SimulatedSets, index: int
) -> ExactSetPosterior:
    r"""The posterior of a system (m, terms + 1), as `SetPosterior` has it, sampled at length.

    .. math:: \log p(y | x) = -\tfrac12 | S^{-1} A b(x) |^2 + const, \qquad I + g g^T = S S^T

    with the last column g the sensor's bias. What a file answers differs from it by its own, short
    sampling only; what it differs by from the exact posterior is the learned response's error, and
    that of a likelihood which is normal in the logarithm of a reading.
    """
    these = terms_of(family)
    a, g = system[:, :-1], system[:, -1]
    size = float(g @ g)
    if size > 0.0:
        a = a - (1.0 - (1.0 + size) ** -0.5) / size * np.outer(g, g @ a)

    def logs(x: Floats) -> Floats:
        return np.asarray(-0.5 * ((monomials(x, these) @ a.T) ** 2).sum(axis=1))

    return posterior(Unknowns.of(family, sets, index), logs, sets.origin.x[index])[0]
