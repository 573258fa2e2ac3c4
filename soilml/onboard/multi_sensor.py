"""Fusion of estimates of the same quantities from different files, for example of slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.joint_errors import are_comparable, joint_errors
from soilml.onboard.set_contract import Floats

#: Estimates further apart than this are contradictory, in standard deviations of the difference.
CONTRADICTION = 4.0
#: Priors that differ by less than this share of their standard deviation count as the same.
SAME_PRIOR = 0.05
#: Loads that differ by less than this share are readings of the same load.
SAME_LOAD = 0.1


@dataclass(frozen=True)
class MultiSensorEstimate:
    """A fused estimate, and how it was made.

    Attributes
    ----------
    estimate : Estimate
        Of leading shape (...).
    used : ndarray of bool, shape (m, ...)
        Which of the m estimates each row used.
    disagreement : ndarray, shape (...)
        The largest difference of two files in standard deviations of that difference: its mean
        square over many readings is about 1 where the files are right for this soil, and well above
        where one is not. 0 for a single file.
    """

    estimate: Estimate
    used: NDArray[np.bool_]
    disagreement: Floats


def fuse_estimates(estimates: Sequence[Estimate]) -> MultiSensorEstimate:
    """Fuse estimates of the same quantities and prior, of a file for each of several sensors.

    They are weighed by variance under the correlation of their errors, which files trained from the
    same data carry (`soilml.onboard.joint_errors`). Intervals are calibrated on held-out rows.

    Estimates out of range are not used. A single remaining one is returned unchanged. Where none
    remains, or where two differ by more than `CONTRADICTION` standard deviations of their
    difference, with the correlation and without, the result is the prior and `in_range` is false.

    Parameters
    ----------
    estimates : sequence of Estimate
        All of one shape (...), with the same names and prior.

    Returns
    -------
    MultiSensorEstimate

    Raises
    ------
    InputError
        For estimates of different quantities, shapes, priors or loads, and of files that do not
        state their errors on common rows.
    """
    _check_compatible(estimates)
    first, q, shape = estimates[0], len(estimates[0].names), estimates[0].in_range.shape
    mean, low, high = (
        np.stack([getattr(e, key).reshape(-1, q) for e in estimates])
        for key in ("mean", "low", "high")
    )
    covariance = np.stack([e.covariance.reshape(-1, q, q) for e in estimates])
    used = np.stack([e.in_range.reshape(-1) for e in estimates])
    contradictory = _contradictory(mean, covariance, used)
    used = used & ~contradictory
    fused = Estimate.from_prior(first.names, first.units, first.prior, (used.shape[1],))
    disagreement = np.zeros(used.shape[1])
    for pattern in np.unique(used, axis=1).T:
        rows, members = (used == pattern[:, None]).all(axis=0), np.flatnonzero(pattern)
        if members.size == 1:
            parts = (mean[members[0]], covariance[members[0]], low[members[0]], high[members[0]])
            found: Sequence[Any] = [part[rows] for part in parts]
        elif members.size > 1:
            files = [errors for i in members if (errors := estimates[int(i)].errors)]
            *found, apart = _fuse(mean[members][:, rows], covariance[members][:, rows], files)
            disagreement[rows], contradictory[rows] = apart, apart > CONTRADICTION
        else:
            continue
        for key, values in zip(("mean", "covariance", "low", "high"), found, strict=True):
            getattr(fused, key)[rows] = values
    if (far := contradictory & used.any(axis=0)).any():
        for key in ("mean", "covariance", "low", "high"):
            prior = Estimate.from_prior(first.names, first.units, first.prior)
            getattr(fused, key)[far] = getattr(prior, key)
        used = used & ~far
    lower, upper = first.prior.lower, first.prior.upper
    std = np.sqrt(np.diagonal(fused.covariance, axis1=1, axis2=2))
    in_range = np.asarray(used.any(axis=0).reshape(shape))
    reason = np.where(in_range, 0, Reason.OUT_OF_RANGE)
    estimate = Estimate(
        names=first.names,
        units=first.units,
        mean=np.clip(fused.mean, lower, upper).reshape(*shape, q),
        std=std.reshape(*shape, q),
        covariance=fused.covariance.reshape(*shape, q, q),
        low=np.clip(fused.low, lower, upper).reshape(*shape, q),
        high=np.clip(fused.high, lower, upper).reshape(*shape, q),
        in_range=in_range,
        prior=first.prior,
        reason=np.where(contradictory.reshape(shape), Reason.CONTRADICTORY, reason),
        load=first.load,
    )
    return MultiSensorEstimate(
        estimate, used.reshape(len(used), *shape), np.asarray(disagreement.reshape(shape))
    )


def _fuse(
    mean: Floats, covariance: Floats, files: Sequence[HeldOutErrors]
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Mean, covariance, ends of the interval, and disagreement (n,), of estimates (m, n, ...).

    The correlation between quantities is the mean over the estimates.
    """
    rules = joint_errors(tuple(files))
    assert rules is not None  # they are comparable
    stds = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3))
    columns = []
    for k, rule in enumerate(rules):
        fused, spread, disagreement = rule.fuse(mean[..., k], stds[..., k])
        columns.append((fused, spread, *rule.interval(fused, spread), disagreement))
    centre, std, low, high, apart = (
        np.stack(column, axis=-1) for column in zip(*columns, strict=True)
    )
    correlation = np.mean(covariance / (stds[..., None] * stds[..., None, :]), axis=0)
    joint = correlation * std[:, :, None] * std[:, None, :]
    return centre, np.asarray(joint), low, high, apart.max(axis=-1)


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
                f"one file estimates {', '.join(first.names)}, another {', '.join(other.names)}: "
                "only estimates of the same quantities, in the same order, can be fused"
            )
        if other.in_range.shape != first.in_range.shape:
            raise InputError(
                f"estimates have the shapes {first.in_range.shape} and {other.in_range.shape}; "
                "needed is one shape"
            )
        off = np.abs(other.load - first.load) > SAME_LOAD * np.abs(first.load)
        if off.any():
            loads = (float(x[off].flat[0]) for x in (first.load, other.load))
            raise InputError(
                f"estimates are of the loads {' and '.join(f'{x:g} N' for x in loads)}; needed are "
                "readings of one slip under one load"
            )
        for key in ("mean", "std", "lower", "upper"):
            own, its = getattr(first.prior, key), getattr(other.prior, key)
            if (np.abs(own - its) > SAME_PRIOR * first.prior.std).any():
                raise InputError(
                    f"the files have different priors of {', '.join(first.names)}: "
                    f"{_format_range(first.prior)} and {_format_range(other.prior)}; train both "
                    "from one recipe"
                )
    files = [given.errors for given in estimates]
    if len(files) == 1:
        return
    known = [errors for errors in files if errors is not None]
    if len({*known}) < len(known):
        raise InputError("two estimates are of one file: give one of each file")
    if not are_comparable(files):
        raise InputError(
            "the files do not state their errors on common rows: train them from one data file"
        )


def _format_range(prior: PriorSummary) -> str:
    lower, upper = (", ".join(f"{v:g}" for v in end) for end in (prior.lower, prior.upper))
    return f"from {lower} to {upper}"
