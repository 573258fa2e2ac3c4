"""Pooling of single-row estimates of one soil as Gaussians, with measured calibration.

This is what a model file without a set posterior does for a run of several rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.features import READABLE
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.set_contract import LEAST_SHARE_IN_RANGE, Floats

#: Least ratio of a row's standard deviation to the prior's, along any direction.
LEAST_STD_RATIO = 1e-3
#: Bins along the trained range of slip and of load; rows in the same or in adjacent bins have the
#: same operating conditions, and their errors are taken as fully correlated.
BINS = 50
#: Information, relative to the prior's, below which a row cannot disagree with the pooled mean.
LEAST_INFORMATION = 0.05

#: Metadata key of each array of `RunConditions`, and of `RunPattern`.
CONDITION_KEYS = {"lower": "lower", "upper": "upper", "std": "std"}
PATTERN_KEYS = {
    "rows": "rows",
    "worth": "information",
    "widening": "std_scale",
    "reach": "coverage_factor",
}


@dataclass(frozen=True)
class RunConditions:
    """Operating conditions of a reading, slip and load, and their spread over the training rows."""

    names: tuple[str, ...]
    lower: Floats  # (d,)
    upper: Floats
    std: Floats

    def row_weights(self, measured: Mapping[str, Floats]) -> Floats:
        """Weight (..., m) of each row: one over the rows in its bin and the adjacent ones.

        The sum of the weights is the effective number of rows. A reading that is repeated, with or
        without new noise, counts once. Dimensions before the last are those of several runs.
        """
        position = (self._conditions(measured) - self.lower) / (self.upper - self.lower)
        # one empty bin on either side, so that no neighbour lies beyond the ends
        index = np.clip(position * BINS, 0, BINS).astype(int) + 1
        strides = (BINS + 3) ** np.arange(len(self.names))
        rows = index.shape[-2]
        bins = (index @ strides).reshape(-1, rows)
        size = (BINS + 3) ** len(self.names)
        bins += size * np.arange(len(bins))[:, None]
        counts = np.bincount(bins.reshape(-1), minlength=size * len(bins))
        steps = (np.asarray(step) @ strides for step in product((-1, 0, 1), repeat=len(strides)))
        near = sum(counts[bins + step] for step in steps)
        return np.asarray(1.0 / near).reshape(index.shape[:-1])

    def variation(self, measured: Mapping[str, Floats], weights: Floats) -> Floats:
        """How much a run varied each condition, (..., d): 0 steady, 1 as the training rows.

        The ratio of weighted standard deviations, smoothed by the cubic 3 r^2 - 2 r^3.
        """
        conditions, count = self._conditions(measured), weights.sum(axis=-1)[..., None]
        mean = np.einsum("...m,...md->...d", weights, conditions) / count
        squared = (conditions - mean[..., None, :]) ** 2
        total = np.einsum("...m,...md->...d", weights, squared)
        ratio = np.minimum(np.sqrt(total / np.maximum(count - 1.0, 0.5)) / self.std, 1.0)
        return np.asarray(ratio**2 * (3.0 - 2.0 * ratio))

    def _conditions(self, measured: Mapping[str, Floats]) -> Floats:
        return np.stack([measured[name] for name in self.names], axis=-1)


@dataclass(frozen=True)
class RunPattern:
    """Calibration of pooling for runs that vary the same operating conditions."""

    varies: tuple[bool, ...]  # (d,) whether each condition varies
    rows: Floats  # (k,) effective numbers of rows at which it was measured: 1, then rising
    information: Floats  # (k,) share of a row's information that is independent of other rows
    std_scale: Floats  # (k, q) factor on the pooled standard deviation
    coverage_factor: Floats  # (k, q) half-width of the 90 % interval in standard deviations

    def interpolate(self, rows: float | Floats) -> Floats:
        """Log information share, std scale and coverage factor, (..., 1 + 2 q).

        Interpolated linearly in the logarithm of the effective number of rows (...). Beyond the
        largest number that was measured, more rows do not reduce the uncertainty any further.
        """
        columns = np.column_stack([np.log(self.information), self.std_scale, self.coverage_factor])
        log_rows, grid = np.log(np.maximum(rows, 1.0)), np.log(self.rows)
        values = np.stack([np.interp(log_rows, grid, column) for column in columns.T], axis=-1)
        values[..., 0] -= np.maximum(log_rows - grid[-1], 0.0)
        return values


@dataclass(frozen=True)
class PoolingRule:
    """Weights and factors for pooling the rows of a run, or of several runs of one length."""

    weights: Floats  # (..., m) share of each row's information that is used
    std_scale: Floats  # (..., q), as in `RunPattern`
    coverage_factor: Floats  # (..., q)


@dataclass(frozen=True)
class PoolingCalibration:
    """Calibration of pooling for runs of any pattern of operating conditions."""

    conditions: RunConditions
    patterns: tuple[RunPattern, ...]
    single_row_coverage_factor: Floats  # (q,) of the 90 % interval of one row
    inconsistency_limits: Floats  # (2,) that rows of one soil hardly ever exceed
    held_out: HeldOutErrors | None = None  # of files whose rows cannot be pooled (slip)

    def label(self, pattern: RunPattern) -> str:
        """Name of a pattern: "steady", "slip free", "slip and load free"."""
        pairs = zip(self.conditions.names, pattern.varies, strict=True)
        names = [name for name, varies in pairs if varies]
        return f"{' and '.join(names)} free" if names else "steady"

    def rule(self, measured: Mapping[str, Floats]) -> PoolingRule:
        """Rule for the rows (..., m) of runs, interpolated between the calibrated patterns."""
        row_weights = self.conditions.row_weights(measured)
        variation = self.conditions.variation(measured, row_weights)
        effective_rows = row_weights.sum(axis=-1)
        mixture = np.zeros(1)
        for pattern in self.patterns:
            share = np.prod(np.where(pattern.varies, variation, 1.0 - variation), axis=-1)
            mixture = mixture + share[..., None] * pattern.interpolate(effective_rows)
        q = self.single_row_coverage_factor.size
        log_information, std_scale, coverage_factor = np.split(mixture, [1, 1 + q], axis=-1)
        return PoolingRule(row_weights * np.exp(log_information), std_scale, coverage_factor)


@dataclass(frozen=True)
class PooledEstimate:
    """Pooled mean (..., q), covariance (..., q, q), and inconsistency (..., 2).

    The first measure of inconsistency is the weighted mean over rows of the squared difference
    between the row's estimate and the pooled mean, in standard deviations of what the row adds to
    the prior. The second is how far the pooled mean lies outside the prior's range, in the prior's
    standard deviations. Both are small for rows of one soil of the training domain.
    """

    mean: Floats
    covariance: Floats
    inconsistency: Floats


@dataclass(frozen=True)
class RowInformation:
    """What rows add to the prior, in standard deviations of the prior along principal axes."""

    axes: Floats  # (..., q, q)
    information: Floats  # (..., q) in addition to the prior's, which is 1
    projected: Floats  # (..., q) mean times precision

    @staticmethod
    def of(mean: Floats, covariance: Floats, prior: PriorSummary) -> RowInformation:
        """Of estimates (..., q) and (..., q, q)."""
        scaled_mean = (mean - prior.mean) / prior.std
        variance, axes = np.linalg.eigh(covariance / np.outer(prior.std, prior.std))
        variance = np.clip(variance, LEAST_STD_RATIO**2, 1.0 - LEAST_STD_RATIO)
        projected = np.einsum("...ji,...j->...i", axes, scaled_mean) / variance
        return RowInformation(axes, 1.0 / variance - 1.0, projected)

    def rows(self, index: NDArray[np.int64]) -> RowInformation:
        """The rows of an index array (..., m)."""
        return RowInformation(self.axes[index], self.information[index], self.projected[index])

    def pool(self, prior: PriorSummary, weights: Floats) -> PooledEstimate:
        """See `pool`; the last dimension before q is that of the rows."""
        axes, information, projected = self.axes, self.information, self.projected
        weighted = weights[..., None] * information
        # sums over rows and axes as one product of matrices
        flat = axes.swapaxes(-1, -2).reshape(*axes.shape[:-3], -1, axes.shape[-1])
        scaled = flat * weighted.reshape(*weighted.shape[:-2], -1, 1)
        inverse = np.linalg.inv(np.eye(axes.shape[-1]) + flat.swapaxes(-1, -2) @ scaled)
        right = weights[..., None] * projected
        right = (right.reshape(*right.shape[:-2], 1, -1) @ flat)[..., 0, :]
        centre = np.einsum("...ij,...j->...i", inverse, right)
        along = (flat @ centre[..., None]).reshape(information.shape)
        residual = projected - information * along
        squared = np.sum(residual**2 / (information + LEAST_INFORMATION), axis=-1)
        disagreement = np.sum(weights / weights.sum(axis=-1, keepdims=True) * squared, axis=-1)
        pooled_mean = prior.mean + prior.std * centre
        outside = np.maximum(prior.lower - pooled_mean, pooled_mean - prior.upper) / prior.std
        return PooledEstimate(
            mean=pooled_mean,
            covariance=np.asarray(inverse * np.outer(prior.std, prior.std)),
            inconsistency=np.stack([disagreement, np.maximum(outside.max(axis=-1), 0.0)], axis=-1),
        )


def pool(mean: Floats, covariance: Floats, prior: PriorSummary, weights: Floats) -> PooledEstimate:
    r"""Pool the estimates of m rows of one soil, counting their common prior once.

    .. math::
        P^{-1} = P_0^{-1} + \sum_i w_i (P_i^{-1} - P_0^{-1}), \quad
        P^{-1} \mu = P_0^{-1} \mu_0 + \sum_i w_i (P_i^{-1} \mu_i - P_0^{-1} \mu_0)

    Directions in which a row is no more certain than the prior contribute nothing.

    mean, covariance (..., m, q) and (..., m, q, q): Estimates of the single rows.
    prior: The prior that every row's estimate contains.
    weights (..., m): Share w of each row's information that is used; below 1 where
        the errors of rows are correlated because their operating conditions, or an unknown bearing,
        are the same.

    References
    ----------
    Tresp, Neural Computation 12, 2000: product rule for conditionally independent measurements.
    It treats the posterior of a row as Gaussian, which it is not; `PoolingCalibration` holds
    measured corrections.
    """
    return RowInformation.of(mean, covariance, prior).pool(prior, weights)


def pool_within_prior(
    mean: Floats, covariance: Floats, prior: PriorSummary, rule: PoolingRule
) -> PooledEstimate:
    """Pool rows (..., m, q) and (..., m, q, q) by a rule; the mean is clipped to the prior's range.

    The scaled standard deviation is at most the prior's, unless the unscaled one is larger.
    """
    estimate = pool(mean, covariance, prior, rule.weights)
    unscaled = np.sqrt(np.diagonal(estimate.covariance, axis1=-2, axis2=-1))
    scale = np.minimum(rule.std_scale, np.maximum(prior.std / unscaled, 1.0))
    return PooledEstimate(
        mean=np.clip(estimate.mean, prior.lower, prior.upper),
        covariance=estimate.covariance * scale[..., :, None] * scale[..., None, :],
        inconsistency=estimate.inconsistency,
    )


def pool_run(
    single: Estimate, measured: Mapping[str, Floats], calibration: PoolingCalibration
) -> Estimate:
    """Pool the single-row estimates (m,) of a run of one soil into one estimate.

    single: Estimates of the m rows, each by itself.
    measured (m,): The readings, among them the operating conditions of the calibration.
    calibration: Calibration from held-out runs.

    Returns: The prior, with the reason, where more than half of the rows are out of range, or
    where the rows are less consistent with each other than rows of one soil hardly ever are.
    """
    valid = single.in_range
    head = single.names, single.units, single.prior
    if valid.size == 1:
        parts = (single.mean[0], single.covariance[0], single.std[0], valid[0])
        return Estimate.gaussian(*head, *parts, calibration.single_row_coverage_factor)
    count: dict[str, Any] = {
        "rows_used": np.asarray(int(valid.sum())),
        "rows_set_aside": np.asarray(int((~valid).sum())),
    }
    if valid.sum() < LEAST_SHARE_IN_RANGE * valid.size:
        return replace(Estimate.from_prior(*head), **count)
    rule = calibration.rule({name: values[valid] for name, values in measured.items()})
    pooled = pool_within_prior(single.mean[valid], single.covariance[valid], single.prior, rule)
    if bool((pooled.inconsistency > calibration.inconsistency_limits).any()):
        reason = np.asarray(int(Reason.INCONSISTENT))
        return replace(Estimate.from_prior(*head), reason=reason, **count)
    std = np.sqrt(np.diag(pooled.covariance))
    parts = (pooled.mean, pooled.covariance, std, np.asarray(True))
    return replace(Estimate.gaussian(*head, *parts, rule.coverage_factor), **count)


def read_pooling(entry: Mapping[str, Any]) -> PoolingCalibration:
    """The pooling calibration from the metadata entry "together".

    Raises `KeyError`, `TypeError` or `ValueError` where it is malformed.
    """
    names = tuple(entry["over"])
    conditions = RunConditions(
        names=names,
        **{
            field: np.asarray(entry[key], float).reshape(len(names))
            for key, field in CONDITION_KEYS.items()
        },
    )
    if not {*names} <= READABLE.keys():
        raise ValueError("conditions that are no readings")
    alone = np.asarray(entry["alone"], float).reshape(-1)
    patterns = tuple(_read_pattern(kind, len(names), alone.size) for kind in entry["kinds"])
    return PoolingCalibration(
        conditions=conditions,
        patterns=patterns,
        single_row_coverage_factor=alone,
        inconsistency_limits=np.asarray(entry["doubt"], float).reshape(2 if patterns else -1),
        held_out=HeldOutErrors.of(entry["held_out"]) if "held_out" in entry else None,
    )


def _read_pattern(entry: Mapping[str, Any], conditions: int, outputs: int) -> RunPattern:
    arrays = {field: np.asarray(entry[key], float) for key, field in PATTERN_KEYS.items()}
    rows = len(arrays["rows"])
    shapes = [(rows,), (rows,), (rows, outputs), (rows, outputs)]
    varies = tuple(entry["varies"])
    if [array.shape for array in arrays.values()] != shapes or len(varies) != conditions:
        raise ValueError("kinds of another shape")
    return RunPattern(varies=varies, **arrays)


def write_pooling(pooling: PoolingCalibration) -> dict[str, Any]:
    """The metadata entry "together" of a pooling calibration; the inverse of `read_pooling`."""
    conditions = pooling.conditions
    return {
        "over": conditions.names,
        **{key: getattr(conditions, field).tolist() for key, field in CONDITION_KEYS.items()},
        "kinds": [
            {"varies": pattern.varies}
            | {key: getattr(pattern, field).tolist() for key, field in PATTERN_KEYS.items()}
            for pattern in pooling.patterns
        ],
        "alone": pooling.single_row_coverage_factor.tolist(),
        "doubt": pooling.inconsistency_limits.tolist(),
        **({} if pooling.held_out is None else {"held_out": pooling.held_out.entry()}),
    }
