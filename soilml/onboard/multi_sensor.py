"""Estimates of the same quantities from different files as one: slip by torque and by vibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.numerics.estimate_fusion import BEST_LINEAR, RULES
from soilml.onboard.estimate import Estimate, pooled

Floats = NDArray[np.float64]

#: The rule for estimates of independent errors under one prior: each brings what it adds to that.
PRIOR_ONCE = "prior-once"
#: Rules by which estimates of different files can be fused.
ACROSS_FILES = (PRIOR_ONCE, *(rule for rule in RULES if rule != BEST_LINEAR))
#: Estimates that differ by more standard deviations of their difference contradict each other.
APART = 4.0
#: Half-width of a Gaussian's 90 % interval, in standard deviations.
GAUSSIAN_90 = 1.645
#: Priors that differ by less than this share of their width are one.
SAME_PRIOR = 0.05


@dataclass(frozen=True)
class MultiSensorEstimate:
    """Several estimates as one, and which of them took part in each row, (m, ...)."""

    estimate: Estimate
    used: NDArray[np.bool_]


def fused_estimates(estimates: Sequence[Estimate], rule: str = PRIOR_ONCE) -> MultiSensorEstimate:
    r"""Estimates (...) of the same quantities under the same prior, made from different sensors.

    An estimate that is out of range takes no part. One that is left alone is passed on as it is;
    where none is left, or where two differ by more than `APART` standard deviations of their
    difference, the answer is the prior and `in_range` false. The rule `prior-once`,

    .. math:: P^{-1} = P_0^{-1} + \sum_i (P_i^{-1} - P_0^{-1}),

    is right where errors of the sensors are independent: every estimate holds the prior, which
    must count once. `inverse-variance` (Comin and Saaj 2017, eq. 26) and `pairwise` (eq. 30) count
    it each time: the same where a reading says far more than the prior, too sure where it does
    not. `covariance-intersection` holds whatever the errors have in common, such as a soil that is
    known to none of them. Errors that files share are not known here, and the intervals are those
    of a Gaussian: a single file that joins all sensors knows both, and is measured. Raises
    `InputError` for estimates that are not of one kind.
    """
    if rule not in ACROSS_FILES:
        raise InputError(f"rule is {rule!r}; for estimates of several files: {_list(ACROSS_FILES)}")
    _check_alike(estimates)
    first = estimates[0]
    q, shape = len(first.names), first.in_range.shape
    used = np.stack([e.in_range.reshape(-1) for e in estimates])
    mean = np.stack([e.mean.reshape(-1, q) for e in estimates])
    covariance = np.stack([e.covariance.reshape(-1, q, q) for e in estimates])
    ends = np.stack([np.stack([e.low, e.high]).reshape(2, -1, q) for e in estimates])
    used = used & ~_contradicts(mean, covariance, used)
    prior, n = first.prior, used.shape[1]
    out_mean = np.tile(prior.mean, (n, 1))
    out_covariance = np.tile(np.diag(prior.std**2), (n, 1, 1))
    out_ends = np.stack([out_mean - GAUSSIAN_90 * prior.std, out_mean + GAUSSIAN_90 * prior.std])
    for pattern in np.unique(used, axis=1).T:
        rows, those = (used == pattern[:, None]).all(axis=0), np.flatnonzero(pattern)
        if those.size == 1:
            (only,) = those
            out_mean[rows], out_covariance[rows] = mean[only, rows], covariance[only, rows]
            out_ends[:, rows] = ends[only][:, rows]
        elif those.size > 1:
            parts = mean[those][:, rows], covariance[those][:, rows]
            out_mean[rows], out_covariance[rows] = _fused(*parts, first, rule)
            half = GAUSSIAN_90 * np.sqrt(np.diagonal(out_covariance[rows], axis1=1, axis2=2))
            out_ends[:, rows] = out_mean[rows] - half, out_mean[rows] + half
    low, high = np.clip(out_ends, prior.lower, prior.upper).reshape(2, *shape, q)
    return MultiSensorEstimate(
        Estimate(
            names=first.names,
            units=first.units,
            mean=np.clip(out_mean, prior.lower, prior.upper).reshape(*shape, q),
            std=np.sqrt(np.diagonal(out_covariance, axis1=1, axis2=2)).reshape(*shape, q),
            covariance=out_covariance.reshape(*shape, q, q),
            low=low,
            high=high,
            in_range=np.asarray(used.any(axis=0).reshape(shape)),
            prior=prior,
        ),
        used.reshape(len(estimates), *shape),
    )


def _fused(mean: Floats, covariance: Floats, like: Estimate, rule: str) -> tuple[Floats, Floats]:
    """Mean (n, q) and covariance (n, q, q) of estimates (m, n, q) and (m, n, q, q)."""
    if rule == PRIOR_ONCE:
        share = np.ones((mean.shape[1], mean.shape[0]))
        joint = pooled(np.moveaxis(mean, 0, 1), np.moveaxis(covariance, 0, 1), like.prior, share)
        return joint.mean, joint.covariance
    std = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3))
    fused = RULES[rule](mean, std)
    correlation = np.mean(covariance / (std[..., None] * std[..., None, :]), axis=0)
    return fused.mean, correlation * fused.std[:, :, None] * fused.std[:, None, :]


def _contradicts(mean: Floats, covariance: Floats, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows (n,) in which two estimates that are in range cannot both be right."""
    variance = np.diagonal(covariance, axis1=2, axis2=3)
    found = np.zeros(used.shape[1], dtype=bool)
    for i in range(len(mean)):
        for j in range(i):
            off = (mean[i] - mean[j]) ** 2 > APART**2 * (variance[i] + variance[j])
            found |= used[i] & used[j] & off.any(axis=-1)
    return found


def _check_alike(estimates: Sequence[Estimate]) -> None:
    if not estimates:
        raise InputError("no estimate given; needed is one or more")
    first = estimates[0]
    for other in estimates[1:]:
        if other.names != first.names:
            raise InputError(
                f"one file estimates {_list(first.names)}, another {_list(other.names)}: only "
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
                    f"the files have other priors of {_list(first.names)}: one from "
                    f"{_numbers(first.prior.lower)} to {_numbers(first.prior.upper)}, another from "
                    f"{_numbers(other.prior.lower)} to {_numbers(other.prior.upper)}; train both "
                    "from one recipe"
                )


def _numbers(values: Floats) -> str:
    return ", ".join(f"{v:g}" for v in values)


def _list(words: Sequence[str]) -> str:
    return ", ".join(words)
