"""Fusion of estimates of the same quantities from different files, for example of slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.numerics.estimate_fusion import BEST_LINEAR, RULES
from soilml.onboard.estimate import Estimate, PriorSummary
from soilml.onboard.gaussian_pooling import pool
from soilml.quantities import Z_90

Floats = NDArray[np.float64]

#: Fusion of estimates with independent errors and a common prior, which is counted once.
PRIOR_ONCE = "prior-once"
#: Rules by which estimates of different files can be fused; `best-linear` needs the correlation of
#: their errors, which is known only within one file.
ACROSS_FILES = (PRIOR_ONCE, *(rule for rule in RULES if rule != BEST_LINEAR))
#: Estimates further apart than this are contradictory, in standard deviations of the difference.
CONTRADICTION = 4.0
#: Priors that differ by less than this share of their standard deviation count as the same.
SAME_PRIOR = 0.05


@dataclass(frozen=True)
class MultiSensorEstimate:
    """A fused estimate (...), and which of the m estimates it used in each row, (m, ...)."""

    estimate: Estimate
    used: NDArray[np.bool_]


def fuse_estimates(estimates: Sequence[Estimate], rule: str = PRIOR_ONCE) -> MultiSensorEstimate:
    r"""Fuse estimates of the same quantities and prior that were made from different sensors.

    Estimates out of range are not used. A single remaining one is returned unchanged. Where none
    remains, or where two differ by more than `CONTRADICTION` standard deviations of their
    difference, the result is the prior and `in_range` is false.

    Parameters
    ----------
    estimates : sequence of Estimate
        All of one shape (...), with the same names and prior.
    rule : str
        One of `ACROSS_FILES`. `prior-once`,

        .. math:: P^{-1} = P_0^{-1} + \sum_i (P_i^{-1} - P_0^{-1}),

        is exact for Gaussian estimates whose errors are independent. `inverse-variance` (Comin and
        Saaj 2017, eq. 26) and `pairwise` (eq. 30) count the prior in every estimate: they are
        overconfident unless the readings are far more informative than the prior.
        `covariance-intersection` is conservative whatever the correlation of the errors, for
        example through a soil outside the prior of every file.

    Returns
    -------
    MultiSensorEstimate
        Its intervals are Gaussian. A single file trained on all sensors accounts for correlated
        errors and has calibrated intervals.

    Raises
    ------
    InputError
        For an unknown rule, and for estimates of different quantities, shapes or priors.
    """
    if rule not in ACROSS_FILES:
        raise InputError(f"rule is {rule!r}; for estimates of several files: {_join(ACROSS_FILES)}")
    _check_compatible(estimates)
    stacked = _stack_rows(estimates)
    used = np.stack([e.in_range.reshape(-1) for e in estimates])
    used = used & ~_contradictory(stacked.mean, stacked.covariance, used)
    fused = _fuse_rows(stacked, used, estimates[0].prior, rule)
    return _as_estimate(fused, used, estimates[0])


@dataclass(frozen=True)
class _Rows:
    """Mean (..., n, q), covariance (..., n, q, q) and ends of the interval (..., 2, n, q)."""

    mean: Floats
    covariance: Floats
    ends: Floats


def _stack_rows(estimates: Sequence[Estimate]) -> _Rows:
    """All m estimates with their leading dimensions flattened to n rows."""
    q = len(estimates[0].names)
    return _Rows(
        mean=np.stack([e.mean.reshape(-1, q) for e in estimates]),
        covariance=np.stack([e.covariance.reshape(-1, q, q) for e in estimates]),
        ends=np.stack([np.stack([e.low, e.high]).reshape(2, -1, q) for e in estimates]),
    )


def _fuse_rows(stacked: _Rows, used: NDArray[np.bool_], prior: PriorSummary, rule: str) -> _Rows:
    """Fused rows from the estimates that are used in each, (m, n); the prior where none is."""
    n = used.shape[1]
    mean = np.tile(prior.mean, (n, 1))
    covariance = np.tile(np.diag(prior.std**2), (n, 1, 1))
    ends = np.stack([mean - Z_90 * prior.std, mean + Z_90 * prior.std])
    for pattern in np.unique(used, axis=1).T:
        rows, members = (used == pattern[:, None]).all(axis=0), np.flatnonzero(pattern)
        if members.size == 1:
            (only,) = members
            mean[rows] = stacked.mean[only, rows]
            covariance[rows] = stacked.covariance[only, rows]
            ends[:, rows] = stacked.ends[only][:, rows]
        elif members.size > 1:
            parts = stacked.mean[members][:, rows], stacked.covariance[members][:, rows]
            mean[rows], covariance[rows] = _fuse(*parts, prior, rule)
            half = Z_90 * np.sqrt(np.diagonal(covariance[rows], axis1=1, axis2=2))
            ends[:, rows] = mean[rows] - half, mean[rows] + half
    return _Rows(mean, covariance, ends)


def _as_estimate(fused: _Rows, used: NDArray[np.bool_], first: Estimate) -> MultiSensorEstimate:
    """The fused rows with the leading dimensions, names and prior of the first estimate."""
    q, shape, prior = len(first.names), first.in_range.shape, first.prior
    low, high = np.clip(fused.ends, prior.lower, prior.upper).reshape(2, *shape, q)
    std = np.sqrt(np.diagonal(fused.covariance, axis1=1, axis2=2))
    estimate = Estimate(
        names=first.names,
        units=first.units,
        mean=np.clip(fused.mean, prior.lower, prior.upper).reshape(*shape, q),
        std=std.reshape(*shape, q),
        covariance=fused.covariance.reshape(*shape, q, q),
        low=low,
        high=high,
        in_range=np.asarray(used.any(axis=0).reshape(shape)),
        prior=prior,
    )
    return MultiSensorEstimate(estimate, used.reshape(len(used), *shape))


def _fuse(
    mean: Floats, covariance: Floats, prior: PriorSummary, rule: str
) -> tuple[Floats, Floats]:
    """Mean (n, q) and covariance (n, q, q) of estimates (m, n, q) and (m, n, q, q)."""
    if rule == PRIOR_ONCE:
        weights = np.ones((mean.shape[1], mean.shape[0]))
        pooled = pool(np.moveaxis(mean, 0, 1), np.moveaxis(covariance, 0, 1), prior, weights)
        return pooled.mean, pooled.covariance
    std = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3))
    fused = RULES[rule](mean, std)
    correlation = np.mean(covariance / (std[..., None] * std[..., None, :]), axis=0)
    return fused.mean, correlation * fused.std[:, :, None] * fused.std[:, None, :]


def _contradictory(mean: Floats, covariance: Floats, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows (n,) in which two estimates that are in range contradict each other."""
    variance = np.diagonal(covariance, axis1=2, axis2=3)
    contradictory = np.zeros(used.shape[1], dtype=bool)
    for i in range(len(mean)):
        for j in range(i):
            apart = (mean[i] - mean[j]) ** 2 > CONTRADICTION**2 * (variance[i] + variance[j])
            contradictory |= used[i] & used[j] & apart.any(axis=-1)
    return contradictory


def _check_compatible(estimates: Sequence[Estimate]) -> None:
    if not estimates:
        raise InputError("no estimate given; needed is one or more")
    first = estimates[0]
    for other in estimates[1:]:
        if other.names != first.names:
            raise InputError(
                f"one file estimates {_join(first.names)}, another {_join(other.names)}: only "
                "estimates of the same quantities, in the same order, can be fused"
            )
        if other.in_range.shape != first.in_range.shape:
            raise InputError(
                f"estimates have the shapes {first.in_range.shape} and {other.in_range.shape}; "
                "needed is one shape"
            )
        for key in ("mean", "std", "lower", "upper"):
            own, its = getattr(first.prior, key), getattr(other.prior, key)
            if (np.abs(own - its) > SAME_PRIOR * first.prior.std).any():
                raise InputError(
                    f"the files have different priors of {_join(first.names)}: "
                    f"{_format_range(first.prior)} and {_format_range(other.prior)}; train both "
                    "from one recipe"
                )


def _format_range(prior: PriorSummary) -> str:
    lower, upper = (", ".join(f"{v:g}" for v in end) for end in (prior.lower, prior.upper))
    return f"from {lower} to {upper}"


def _join(words: Sequence[str]) -> str:
    return ", ".join(words)
