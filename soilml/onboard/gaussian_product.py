"""The product of Gaussian estimates of one soil, and of an estimate with a narrower prior."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.errors import InputError
from soilml.onboard.features import as_numbers
from soilml.onboard.set_contract import Floats

#: Least ratio of an estimate's standard deviation to the prior's, along any direction.
LEAST_STD_RATIO = 1e-3
#: Turns after which the nearest point of a box has settled.
DESCENTS = 40


@dataclass(frozen=True)
class PriorSummary:
    """Mean, standard deviation and range of each quantity before any measurement, each (q,)."""

    mean: Floats
    std: Floats
    lower: Floats
    upper: Floats


def narrowed(
    prior: PriorSummary,
    names: Sequence[str],
    units: Sequence[str],
    box: Mapping[str, tuple[float, float]],
) -> PriorSummary:
    """A prior that is uniform in a box; raises `InputError` for ends not in it and in order."""
    lower, upper = prior.lower.copy(), prior.upper.copy()
    for name, ends in box.items():
        if name not in names:
            raise InputError(f"{name!r} is not estimated; there are: {', '.join(names)}")
        i, given = names.index(name), as_numbers(name, ends)
        if given.shape != (2,):
            raise InputError(f"{name} within {ends!r}; needed are two values, (least, largest)")
        low, high = given
        if not lower[i] <= low < high <= upper[i]:
            raise InputError(
                f"{name} within {low:g} to {high:g} {units[i]}; needed are two values in "
                f"order within the prior, {lower[i]:g} to {upper[i]:g} {units[i]}"
            )
        lower[i], upper[i] = low, high
    return PriorSummary(0.5 * (lower + upper), (upper - lower) / math.sqrt(12.0), lower, upper)


def distance_to_box(mean: Floats, covariance: Floats, prior: PriorSummary) -> Floats:
    """Least distance (...) of a prior's box from means (..., q), in their standard deviations.

    That of Mahalanobis (Proc. Nat. Inst. Sci. India 2, 1936), by descent along each quantity.
    """
    inverse, lower, upper = np.linalg.inv(covariance), prior.lower, prior.upper
    off = np.clip(mean, lower, upper) - mean
    for _ in range(DESCENTS):
        for i in range(off.shape[-1]):
            own = inverse[..., i, i]
            rest = (inverse[..., i, :] * off).sum(axis=-1) - own * off[..., i]
            off[..., i] = np.clip(-rest / own, lower[i] - mean[..., i], upper[i] - mean[..., i])
    return np.asarray(np.sqrt(np.einsum("...i,...ij,...j", off, inverse, off)))


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
