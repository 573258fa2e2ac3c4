"""An estimate with its uncertainty, and several of one soil as one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Share of the prior's spread above which an estimate is mostly the prior.
VAGUE = 0.8
#: No row may claim to be surer of nothing than the prior.
LEAST_SHARE = 1e-3
#: Cells along the trained range of slip and of load; rows in one or in two that touch are alike.
CELLS = 50
#: Information below this share of the prior's is too little to disagree by.
LEAST_GAIN = 0.05


@dataclass(frozen=True)
class Estimate:
    """Mean, standard deviation and covariance of the quantities `names`, in SI units.

    Arrays have the shape of the readings with (q,) or (q, q) behind. `low` and `high` hold 90 % of
    the truths. `in_range` is false where the readings are unlike all that the model was trained
    on: believe nothing then. `prior` is what was known before anything was measured.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    low: Floats
    high: Floats
    in_range: NDArray[np.bool_]
    prior: PriorSummary

    @property
    def abstains(self) -> NDArray[np.bool_]:
        """Whether what was measured does not tell a quantity, (..., q): it is mostly the prior."""
        vague = self.std > VAGUE * self.prior_std
        return np.asarray(vague | ~np.asarray(self.in_range)[..., None])

    @property
    def prior_std(self) -> Floats:
        """The width before anything was measured, (q,)."""
        return self.prior.std

    def __getitem__(self, name: str) -> tuple[Floats, Floats]:
        """(mean, std) of one quantity."""
        i = self.names.index(name)
        return self.mean[..., i], self.std[..., i]


@dataclass(frozen=True)
class RunConditions:
    """What the driver chooses of a reading, slip and load, and how the training varied it."""

    names: tuple[str, ...]
    lower: Floats  # (d,) of the rows that were learned from
    upper: Floats
    std: Floats

    def fresh(self, measured: Mapping[str, Floats]) -> Floats:
        """What each row (m,) counts: one over the number of rows driven as it was, itself included.

        Rows are alike whose cells of a lattice over the range touch, so that a reading that is
        repeated, with or without new noise, counts once.
        """
        share = (self._chosen(measured) - self.lower) / (self.upper - self.lower)
        cell = tuple(np.clip(share * CELLS, 0, CELLS).astype(int).T + 1)
        alike = np.zeros((CELLS + 3,) * len(self.names))
        np.add.at(alike, cell, 1.0)
        for axis in range(alike.ndim):
            alike = alike + np.roll(alike, 1, axis) + np.roll(alike, -1, axis)
        return np.asarray(1.0 / alike[cell])

    def varied(self, measured: Mapping[str, Floats], fresh: Floats) -> Floats:
        """How much a run varied each quantity, (d,): 0 steady, 1 as much as the training did."""
        chosen, count = self._chosen(measured), fresh.sum()
        off = chosen - fresh @ chosen / count
        variance = fresh @ off**2 / max(count - 1.0, 0.5)
        share = np.minimum(np.sqrt(variance) / self.std, 1.0)
        return np.asarray(share**2 * (3.0 - 2.0 * share))

    def _chosen(self, measured: Mapping[str, Floats]) -> Floats:
        return np.stack([measured[name] for name in self.names], axis=-1)


@dataclass(frozen=True)
class RunPattern:
    """How surely rows of one soil may be joined, in runs that varied the same; measured."""

    varies: tuple[bool, ...]  # (d,) which of what is driven
    rows: Floats  # (k,) numbers of unlike rows at which it was measured: 1, and rising
    worth: Floats  # (k,) how much of what a row seems to tell is told by no other row
    widening: Floats  # (k, q) what the joined standard deviation must be multiplied by
    reach: Floats  # (k, q) half-width of the 90 % interval in standard deviations

    def at(self, count: float) -> Floats:
        """Logarithm of the worth, widening and reach for a number of rows, (1 + 2 q,).

        Interpolated in its logarithm. Rows beyond the largest number measured are averaged in, but
        no longer narrow the answer.
        """
        columns = np.column_stack([np.log(self.worth), self.widening, self.reach])
        place, grid = np.log(max(count, 1.0)), np.log(self.rows)
        found = np.asarray([np.interp(place, grid, column) for column in columns.T])
        found[0] -= max(place - grid[-1], 0.0)
        return found


@dataclass(frozen=True)
class PoolingRule:
    """How the rows of one run are to be joined."""

    share: Floats  # (m,) of what each row seems to tell that is believed
    widening: Floats  # (q,), as in `RunPattern`
    reach: Floats  # (q,)


@dataclass(frozen=True)
class PoolingCalibration:
    """How surely the estimates of several rows of one soil may be joined, in runs of any kind."""

    driven: RunConditions
    kinds: tuple[RunPattern, ...]
    alone: Floats  # (q,) half-width of the 90 % interval of one row, in standard deviations
    doubt: Floats  # (2,) what rows of one soil hardly ever exceed, see `PooledEstimate`

    def said(self, kind: RunPattern) -> str:
        """A kind of run in words."""
        names = [n for n, free in zip(self.driven.names, kind.varies, strict=True) if free]
        return f"{' and '.join(names)} free" if names else "steady"

    def rule(self, measured: Mapping[str, Floats]) -> PoolingRule:
        """The rule for rows (m,) of one run, between the kinds of run that were measured."""
        fresh = self.driven.fresh(measured)
        varied = self.driven.varied(measured, fresh)
        near = [np.prod(np.where(kind.varies, varied, 1.0 - varied)) for kind in self.kinds]
        between = near @ np.stack([kind.at(fresh.sum()) for kind in self.kinds])
        worth, widening, reach = np.split(between, [1, 1 + self.alone.size])
        return PoolingRule(fresh * np.exp(worth), widening, reach)


@dataclass(frozen=True)
class PooledEstimate:
    """Several rows' estimates as one: mean (..., q), covariance (..., q, q), and doubt (..., 2).

    The first doubt is how far the rows disagree with the joined mean: the mean square over rows, by
    what each counts, of what it says beyond it in its own standard deviations. The second is how
    far the joined mean lies outside the prior's range, in the prior's standard deviations. Both are
    small for rows of one soil that the training knows.
    """

    mean: Floats
    covariance: Floats
    doubt: Floats


@dataclass(frozen=True)
class PriorSummary:
    """What is known before anything is measured: mean, std and range of each parameter, (q,)."""

    mean: Floats
    std: Floats
    lower: Floats
    upper: Floats


def pooled(mean: Floats, covariance: Floats, prior: PriorSummary, share: Floats) -> PooledEstimate:
    r"""One estimate from those of m rows of one soil, (..., m, q) and (..., m, q, q).

    .. math::
        P^{-1} = P_0^{-1} + \sum_i w_i (P_i^{-1} - P_0^{-1}), \quad
        P^{-1} \mu = P_0^{-1} \mu_0 + \sum_i w_i (P_i^{-1} \mu_i - P_0^{-1} \mu_0)

    Every row's estimate contains the prior; it must count once. Directions in which a row is no
    surer than the prior count for nothing. `share` w (..., m) is below 1 where rows err alike: they
    were driven alike, or the same bearing of the soil is unknown to all. References: Gaussian
    product rule for conditionally independent measurements (Tresp, Neural Computation 12, 2000). It
    treats the posterior of a row as a Gaussian, which it is not: `PoolingCalibration` holds what
    that costs.
    """
    q = mean.shape[-1]
    white_mean = (mean - prior.mean) / prior.std
    white = covariance / np.outer(prior.std, prior.std)
    left, axes = np.linalg.eigh(white)
    left = np.clip(left, LEAST_SHARE**2, 1.0 - LEAST_SHARE)
    gain = 1.0 / left - 1.0
    along = np.einsum("...ji,...j->...i", axes, white_mean) / left
    inverse = np.linalg.inv(
        np.eye(q) + np.einsum("...m,...mij,...mj,...mkj->...ik", share, axes, gain, axes)
    )
    pulled = np.einsum("...m,...mij,...mj->...i", share, axes, along)
    middle = np.einsum("...ij,...j->...i", inverse, pulled)
    beyond = along - gain * np.einsum("...mji,...j->...mi", axes, middle)
    disagreement = np.sum(
        share
        / share.sum(axis=-1, keepdims=True)
        * np.sum(beyond**2 / (gain + LEAST_GAIN), axis=-1),
        axis=-1,
    )
    joint = prior.mean + prior.std * middle
    outside = np.maximum(prior.lower - joint, joint - prior.upper) / prior.std
    return PooledEstimate(
        mean=joint,
        covariance=np.asarray(inverse * np.outer(prior.std, prior.std)),
        doubt=np.stack([disagreement, np.maximum(outside.max(axis=-1), 0.0)], axis=-1),
    )


def pooled_within_prior(
    mean: Floats, covariance: Floats, prior: PriorSummary, rule: PoolingRule
) -> PooledEstimate:
    """Rows (m, q) and (m, q, q) joined by a rule: inside the prior's range, no wider than it."""
    joint = pooled(mean, covariance, prior, rule.share)
    claimed = np.sqrt(np.diag(joint.covariance))
    widening = np.minimum(rule.widening, np.maximum(prior.std / claimed, 1.0))
    return PooledEstimate(
        mean=np.clip(joint.mean, prior.lower, prior.upper),
        covariance=joint.covariance * np.outer(widening, widening),
        doubt=joint.doubt,
    )
