"""The product of Gaussian estimates of one soil, and of an estimate with a narrower prior."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from soilml.onboard.set_contract import Floats

if TYPE_CHECKING:
    from soilml.onboard.estimate import PriorSummary

#: Least ratio of an estimate's standard deviation to the prior's, along any direction.
LEAST_STD_RATIO = 1e-3


def gaussian_product(
    mean: Floats,
    covariance: Floats,
    prior: PriorSummary,
    weight: float = 1.0,
    after: PriorSummary | None = None,
) -> tuple[Floats, Floats]:
    r"""Mean (q,) and covariance (q, q) of estimates (m, q), with another prior in place of theirs.

    .. math::
        P^{-1} = P_a^{-1} + w \sum_i (P_i^{-1} - P_0^{-1}), \quad
        P^{-1} \mu = P_a^{-1} \mu_a + w \sum_i (P_i^{-1} \mu_i - P_0^{-1} \mu_0)

    Directions in which an estimate is no more certain than the prior contribute nothing. The share
    w of their information is used. The prior a is their common one, once, where it is not given.

    References: Tresp, Neural Computation 12, 2000.
    """
    after = after or prior
    own = (prior.std / after.std) ** 2
    variance, axes = np.linalg.eigh(covariance / np.outer(prior.std, prior.std))
    precision = 1.0 / np.clip(variance, LEAST_STD_RATIO**2, 1.0)
    scaled = np.einsum("mji,mj->mi", axes, (mean - prior.mean) / prior.std)
    right = weight * np.einsum("mij,mj->i", axes, precision * scaled)
    added = weight * np.einsum("mik,mk,mjk->ij", axes, precision - 1.0, axes)
    inverse = np.linalg.inv(np.diag(own) + added)
    right = right + own * (after.mean - prior.mean) / prior.std
    return prior.mean + prior.std * (inverse @ right), inverse * np.outer(prior.std, prior.std)
