"""Fusion of estimates of the same quantities from different files, for example of slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.numerics.estimate_fusion import BEST_LINEAR, RULES
from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.fusion.correlated_fusion import fuse_rows
from soilml.onboard.fusion.held_out_errors import HeldOutErrors
from soilml.onboard.fusion.joint_errors import are_comparable
from soilml.onboard.gaussian_pooling import pool
from soilml.quantities import Z_90

Floats = NDArray[np.float64]

#: Fusion by variance and by the correlation of the errors, which the files carry.
CORRELATED = "correlated"
#: Fusion of estimates with independent errors and a common prior, which is counted once.
PRIOR_ONCE = "prior-once"
#: Rules by which estimates of different files can be fused; `best-linear` has one set of weights
#: for all rows, and is for regressors of one file.
ACROSS_FILES = (CORRELATED, PRIOR_ONCE, *(rule for rule in RULES if rule != BEST_LINEAR))
#: Estimates further apart than this are contradictory, in standard deviations of the difference.
CONTRADICTION = 4.0
#: Priors that differ by less than this share of their standard deviation count as the same.
SAME_PRIOR = 0.05


@dataclass(frozen=True)
class MultiSensorEstimate:
    """A fused estimate, and how it was made.

    Attributes
    ----------
    estimate : Estimate
        Of leading shape (...).
    used : ndarray of bool, shape (m, ...)
        Which of the m estimates each row used.
    rule : str
        The rule that was applied.
    disagreement : ndarray, shape (...)
        By the rule `correlated`, the largest difference of two files in standard deviations of that
        difference: its mean square over many readings is about 1 where the files are right for
        this soil, and well above where one is not. 0 for a single file and by other rules.
    """

    estimate: Estimate
    used: NDArray[np.bool_]
    rule: str
    disagreement: Floats


def fuse_estimates(estimates: Sequence[Estimate], rule: str | None = None) -> MultiSensorEstimate:
    r"""Fuse estimates of the same quantities and prior, of several sensors or of one repeatedly.

    Repeated readings must be of one soil, slip and load; each is an estimate of the same file.

    Estimates out of range are not used. A single remaining one is returned unchanged. Where none
    remains, or where two differ by more than `CONTRADICTION` standard deviations of their
    difference, the result is the prior and `in_range` is false.

    Parameters
    ----------
    estimates : sequence of Estimate
        All of one shape (...), with the same names and prior.
    rule : str, optional
        One of `ACROSS_FILES`; `correlated` by default, or `prior-once` where the correlation is not
        known. `correlated` weighs by variance under the correlation of the errors, which files
        trained from the same data carry (`soilml.onboard.fusion.correlated_fusion`): repeated
        readings of a file share the error that its soil causes. Where one file alone was better on
        the held-out rows, the fused estimate is that file's. `prior-once`,

        .. math:: P^{-1} = P_0^{-1} + \sum_i (P_i^{-1} - P_0^{-1}),

        is exact for Gaussian estimates whose errors are independent. `inverse-variance` (Comin and
        Saaj 2017, eq. 26) and `pairwise` (eq. 30) count the prior in every estimate: they are
        overconfident unless the readings are far more informative than the prior.
        `covariance-intersection` is conservative whatever the correlation of the errors, for
        example through a soil outside the prior of every file.

    Returns
    -------
    MultiSensorEstimate
        Its intervals are calibrated on held-out rows by the rule `correlated`, and Gaussian by the
        others, which take repeated readings for independent.

    Raises
    ------
    InputError
        For an unknown rule, for estimates of different quantities, shapes or priors, and for the
        rule `correlated` where the correlation is not known.
    """
    if rule is not None and rule not in ACROSS_FILES:
        raise InputError(f"rule is {rule!r}; for estimates of several files: {_join(ACROSS_FILES)}")
    _check_compatible(estimates)
    known = are_comparable([e.errors for e in estimates])
    if rule == CORRELATED and not known:
        raise InputError(
            "rule is 'correlated', but the files do not carry their errors on common rows: train "
            "them from one data file, or give another rule"
        )
    rule = rule or (CORRELATED if known else PRIOR_ONCE)
    stacked = _stack_rows(estimates)
    used = np.stack([e.in_range.reshape(-1) for e in estimates])
    contradictory = _contradictory(stacked.mean, stacked.covariance, used)
    used = used & ~contradictory
    files = [e.errors for e in estimates if e.errors is not None] if rule == CORRELATED else []
    fused = _fuse_rows(stacked, used, estimates[0].prior, rule, files)
    found = _as_estimate(fused, used, estimates[0], rule)
    shape = found.estimate.in_range.shape
    reason = np.where(contradictory.reshape(shape), Reason.CONTRADICTORY, found.estimate.reason)
    return replace(found, estimate=replace(found.estimate, reason=reason))


@dataclass(frozen=True)
class _Rows:
    """Mean (..., n, q), covariance (..., n, q, q) and ends of the interval (..., 2, n, q).

    Fused rows also have their disagreement (n,).
    """

    mean: Floats
    covariance: Floats
    ends: Floats
    disagreement: Floats


def _stack_rows(estimates: Sequence[Estimate]) -> _Rows:
    """All m estimates with their leading dimensions flattened to n rows."""
    q = len(estimates[0].names)
    return _Rows(
        mean=np.stack([e.mean.reshape(-1, q) for e in estimates]),
        covariance=np.stack([e.covariance.reshape(-1, q, q) for e in estimates]),
        ends=np.stack([np.stack([e.low, e.high]).reshape(2, -1, q) for e in estimates]),
        disagreement=np.zeros(estimates[0].in_range.size),
    )


def _fuse_rows(
    stacked: _Rows,
    used: NDArray[np.bool_],
    prior: PriorSummary,
    rule: str,
    files: Sequence[HeldOutErrors],
) -> _Rows:
    """Fused rows from the estimates that are used in each, (m, n); the prior where none is."""
    n = used.shape[1]
    mean = np.tile(prior.mean, (n, 1))
    covariance = np.tile(np.diag(prior.std**2), (n, 1, 1))
    ends = np.stack([mean - Z_90 * prior.std, mean + Z_90 * prior.std])
    disagreement = np.zeros(n)
    for pattern in np.unique(used, axis=1).T:
        rows, members = (used == pattern[:, None]).all(axis=0), np.flatnonzero(pattern)
        if members.size == 1:
            (only,) = members
            mean[rows] = stacked.mean[only, rows]
            covariance[rows] = stacked.covariance[only, rows]
            ends[:, rows] = stacked.ends[only][:, rows]
        elif members.size > 1 and rule == CORRELATED:
            std = np.sqrt(np.diagonal(stacked.covariance[members][:, rows], axis1=2, axis2=3))
            by = [files[int(i)] for i in members]
            found = fuse_rows(stacked.mean[members][:, rows], std, by)
            mean[rows], ends[:, rows] = found.mean, (found.low, found.high)
            disagreement[rows] = found.disagreement.max(axis=-1)
            correlation = _mean_correlation(stacked.covariance[members][:, rows])
            covariance[rows] = correlation * found.std[:, :, None] * found.std[:, None, :]
        elif members.size > 1:
            parts = stacked.mean[members][:, rows], stacked.covariance[members][:, rows]
            mean[rows], covariance[rows] = _fuse(*parts, prior, rule)
            half = Z_90 * np.sqrt(np.diagonal(covariance[rows], axis1=1, axis2=2))
            ends[:, rows] = mean[rows] - half, mean[rows] + half
    return _Rows(mean, covariance, ends, disagreement)


def _as_estimate(
    fused: _Rows, used: NDArray[np.bool_], first: Estimate, rule: str
) -> MultiSensorEstimate:
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
    return MultiSensorEstimate(
        estimate,
        used.reshape(len(used), *shape),
        rule,
        np.asarray(fused.disagreement.reshape(shape)),
    )


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
    correlation = _mean_correlation(covariance)
    return fused.mean, correlation * fused.std[:, :, None] * fused.std[:, None, :]


def _mean_correlation(covariance: Floats) -> Floats:
    """Correlation (n, q, q) between quantities, the mean over estimates (m, n, q, q)."""
    std = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3))
    return np.asarray(np.mean(covariance / (std[..., None] * std[..., None, :]), axis=0))


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
    for given in estimates:
        if not isinstance(given, Estimate):
            raise InputError(f"an estimate is a {type(given).__name__}; needed is an Estimate")
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
