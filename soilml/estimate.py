"""An estimate of soil parameters with its uncertainty, and several of one soil as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: No row may claim to be surer of nothing than the prior.
LEAST_SHARE = 1e-3
#: Information below this share of the prior's is too little to disagree by.
LEAST_GAIN = 0.05


@dataclass(frozen=True)
class Estimate:
    """Mean, standard deviation and covariance of the parameters `names`, in SI units.

    Arrays have the shape of the readings with (q,) or (q, q) behind. `low` and `high` hold 90 % of
    the truths. `in_range` is false where the readings are unlike all that the model was trained
    on: believe nothing then. `prior_std` is the width before anything was measured.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    low: Floats
    high: Floats
    in_range: NDArray[np.bool_]
    prior_std: Floats

    def __getitem__(self, name: str) -> tuple[Floats, Floats]:
        """(mean, std) of one parameter."""
        i = self.names.index(name)
        return self.mean[..., i], self.std[..., i]


@dataclass(frozen=True)
class Together:
    """How surely the estimates of several rows of one soil may be joined; measured, not assumed."""

    rows: Floats  # (k,) numbers of rows at which it was measured: 1, and rising
    worth: Floats  # (k,) how much of what a row seems to tell is told by no other row
    widening: Floats  # (k, q) what the joined standard deviation must be multiplied by
    reach: Floats  # (k, q) half-width of the 90 % interval in standard deviations
    doubt: Floats  # (k, 2) what rows of one soil hardly ever exceed, see `Joined`

    def at(self, count: int) -> tuple[float, Floats, Floats, Floats]:
        """Worth, widening (q,), reach (q,) and doubt (2,) for a number of rows.

        Interpolated in its logarithm. Rows beyond the largest number measured are averaged in, but
        no longer narrow the answer.
        """
        if count == 1:
            return float(self.worth[0]), self.widening[0], self.reach[0], self.doubt[0]
        place, grid = np.log(min(count, self.rows[-1])), np.log(self.rows)

        def between(values: Floats) -> Floats:
            return np.asarray([np.interp(place, grid, column) for column in values.T])

        worth = float(np.exp(np.interp(place, grid, np.log(self.worth))))
        beyond = min(1.0, float(self.rows[-1]) / count)
        return worth * beyond, between(self.widening), between(self.reach), between(self.doubt)


@dataclass(frozen=True)
class Joined:
    """Several rows' estimates as one: mean (..., q), covariance (..., q, q), and doubt (..., 2).

    The first doubt is how far the rows disagree with the joined mean, the mean square over rows of
    what each says beyond it in its own standard deviations; the second how far the joined mean
    lies outside the prior's range, in the prior's standard deviations. Both are small for rows of
    one soil that the training knows.
    """

    mean: Floats
    covariance: Floats
    doubt: Floats


@dataclass(frozen=True)
class Known:
    """What is known before anything is measured: mean, std and range of each parameter, (q,)."""

    mean: Floats
    std: Floats
    lower: Floats
    upper: Floats


def joined(mean: Floats, covariance: Floats, prior: Known, worth: float) -> Joined:
    r"""One estimate from those of m rows of one soil, (..., m, q) and (..., m, q, q).

    .. math::
        P^{-1} = P_0^{-1} + w \sum_i (P_i^{-1} - P_0^{-1}), \quad
        P^{-1} \mu = P_0^{-1} \mu_0 + w \sum_i (P_i^{-1} \mu_i - P_0^{-1} \mu_0)

    Every row's estimate contains the prior; it must count once. Directions in which a row is no
    surer than the prior count for nothing. `worth` w is below 1 where rows err alike, for example
    because the same bearing of the soil is unknown to all. References: Gaussian product rule for
    conditionally independent measurements (Tresp, Neural Computation 12, 2000). It treats the
    posterior of a row as a Gaussian, which it is not: `Together` holds what that costs.
    """
    q = mean.shape[-1]
    white_mean = (mean - prior.mean) / prior.std
    white = covariance / np.outer(prior.std, prior.std)
    share, axes = np.linalg.eigh(white)
    share = np.clip(share, LEAST_SHARE**2, 1.0 - LEAST_SHARE)
    gain = 1.0 / share - 1.0
    along = np.einsum("...ji,...j->...i", axes, white_mean) / share
    inverse = np.linalg.inv(
        np.eye(q) + worth * np.einsum("...mij,...mj,...mkj->...ik", axes, gain, axes)
    )
    pulled = worth * np.einsum("...mij,...mj->...i", axes, along)
    middle = np.einsum("...ij,...j->...i", inverse, pulled)
    beyond = along - gain * np.einsum("...mji,...j->...mi", axes, middle)
    disagreement = np.mean(np.sum(beyond**2 / (gain + LEAST_GAIN), axis=-1), axis=-1)
    joint = prior.mean + prior.std * middle
    outside = np.maximum(prior.lower - joint, joint - prior.upper) / prior.std
    return Joined(
        mean=joint,
        covariance=np.asarray(inverse * np.outer(prior.std, prior.std)),
        doubt=np.stack([disagreement, np.maximum(outside.max(axis=-1), 0.0)], axis=-1),
    )
