"""Calibration of pooling: errors of pooled rows of one soil against their claimed uncertainty."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.onboard.estimate import PriorSummary
from soilml.onboard.gaussian_pooling import (
    PoolingCalibration,
    RowInformation,
    RunConditions,
    RunPattern,
    pool_within_prior,
)
from soilml.quantities import Z_90
from training.calibration.recalibration import Metrics, compute_metrics
from training.dataset import Dataset

Rows = NDArray[np.int64]

#: Readings that are operating conditions: the driver sets them, the soil does not.
OPERATING_CONDITIONS = ("slip", "load")
#: Numbers of rows at which pooling is calibrated, about evenly spaced in the logarithm.
LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
#: Least number of groups for a 90 % quantile, and most groups of one run, so that none dominates.
LEAST_GROUPS = 50
MOST_GROUPS_OF_A_RUN = 4
FALSE_REJECTION_RATE = 0.002  # Share of consistent sets that may be rejected as inconsistent
#: A condition counts as steady up to this variation, see `RunConditions`, and as free from that.
STEADY, FREE = 0.1, 0.5
NO_LIMIT = 1e9  # Limit of inconsistency that no run exceeds, where none could be measured
#: Candidate shares of a row's information that is independent of the other rows.
INFORMATION_SHARES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.17, 0.12, 0.08, 0.05, 0.03)


def run_conditions(data: Dataset) -> RunConditions:
    """The operating conditions that vary in the training rows, and their spread."""
    varying = tuple(name for name, values in data.measured.items() if np.ptp(values) > 0.0)
    names = tuple(name for name in varying if name in OPERATING_CONDITIONS) or varying[:1]
    values = np.stack([data.measured[name] for name in names])
    return RunConditions(names, values.min(axis=1), values.max(axis=1), values.std(axis=1))


def calibrate_pooling(
    mean: Floats,
    covariance: Floats,
    data: Dataset,
    prior: PriorSummary,
    conditions: RunConditions,
    factor: Floats,
) -> PoolingCalibration:
    """Calibrate the pooling of several rows, by the operating conditions that the run varied.

    For every pattern of varying conditions and every number of rows, the information share with
    the largest likelihood is taken, with the factors that give the intervals their coverage. For a
    pattern with too few runs, pooling does not reduce the uncertainty.

    mean, covariance (n, q) and (n, q, q): Estimates of the rows of `data` by fits that have not
        seen them.
    data: Rows with true values.
    prior: Prior of the targets.
    conditions: Of all rows.
    factor (q,): Half-width of the 90 % interval of single rows, in standard deviations.
    """
    rows = row_groups(data.runs(), 1)
    truth = data.targets[rows[:, 0]]
    information = RowInformation.of(mean, covariance, prior)
    one_row = _measure_groups(information.rows(rows), truth, prior, np.ones(rows.shape))
    by_pattern: dict[tuple[bool, ...], list[_GroupCalibration]] = {}
    for varies in product((False, True), repeat=len(conditions.names)):
        # rows of a steady run add no information: only their inconsistency is measured
        shares = INFORMATION_SHARES if any(varies) else INFORMATION_SHARES[:1]
        by_pattern[varies] = []
        for groups in groups_by_length(runs_with_pattern(varies, data, conditions)):
            weights = conditions.row_weights(measured_rows(data, groups))
            parts = (information.rows(groups), data.targets[groups[:, 0]], prior, weights)
            candidates = [_measure_groups(*parts, share) for share in shares]
            by_pattern[varies].append(min(candidates, key=lambda entry: entry.loss))
    limits = [entry.inconsistency for entry in chain(*by_pattern.values())]
    by_pattern[(False,) * len(conditions.names)] = []
    return PoolingCalibration(
        conditions=conditions,
        patterns=tuple(_pattern(varies, [one_row, *e]) for varies, e in by_pattern.items()),
        single_row_coverage_factor=factor,
        inconsistency_limits=np.max(limits, axis=0) if limits else np.full(2, NO_LIMIT),
    )


def single_rows(conditions: RunConditions, factor: Floats) -> PoolingCalibration:
    """For rows that are not pooled: they have targets of their own, or a set posterior."""
    return PoolingCalibration(conditions, (), factor, np.full(2, NO_LIMIT))


@dataclass(frozen=True)
class _GroupCalibration:
    """One entry of a `RunPattern`, with its loss and its limits of inconsistency."""

    loss: float
    rows: float
    information: float
    std_scale: Floats  # (q,)
    coverage_factor: Floats  # (q,)
    inconsistency: Floats  # (2,)


def _pattern(varies: tuple[bool, ...], entries: list[_GroupCalibration]) -> RunPattern:
    """The entries whose effective number of rows exceeds that of the one before by 2 %."""
    rising: list[_GroupCalibration] = []
    for entry in entries:
        if not rising or entry.rows > 1.02 * rising[-1].rows:
            rising.append(entry)
    return RunPattern(
        varies=varies,
        rows=np.asarray([entry.rows for entry in rising]),
        information=np.asarray([entry.information for entry in rising]),
        std_scale=np.asarray([entry.std_scale for entry in rising]),
        coverage_factor=np.asarray([entry.coverage_factor for entry in rising]),
    )


def _measure_groups(
    rows: RowInformation,
    truth: Floats,
    prior: PriorSummary,
    row_weights: Floats,
    share: float = 1.0,
) -> _GroupCalibration:
    """Errors of groups of rows (groups, m), pooled with one information share.

    Groups beyond the limits of inconsistency are left out: they would be answered with the prior.
    """
    pooled = rows.pool(prior, share * row_weights)
    limits = np.quantile(pooled.inconsistency, 1.0 - FALSE_REJECTION_RATE, axis=0)
    consistent = (pooled.inconsistency <= limits).all(axis=1)
    std = np.sqrt(np.diagonal(pooled.covariance, axis1=1, axis2=2))[consistent]
    error = np.abs(truth - np.clip(pooled.mean, prior.lower, prior.upper))[consistent]
    std_scale = np.sqrt(np.mean((error / std) ** 2, axis=0))
    return _GroupCalibration(
        # negative log likelihood of the scaled Gaussian, without constants
        loss=float(np.mean(np.log(std * std_scale / prior.std))),
        rows=float(np.exp(np.mean(np.log(row_weights.sum(axis=1))))),
        information=share,
        std_scale=std_scale,
        coverage_factor=np.quantile(error / (std * std_scale), 0.9, axis=0),
        inconsistency=limits,
    )


def score_pooling(
    mean: Floats,
    covariance: Floats,
    data: Dataset,
    prior: PriorSummary,
    conditions: RunConditions,
    factor: Floats,
) -> dict[str, dict[int, Metrics]]:
    """Metrics of pooled rows by pattern and number of rows, of `calibrate_pooling` on other runs.

    Pooling is calibrated on half of the runs, and measured on the others.
    """
    half = data.run % 2 == 0
    parts = mean[half], covariance[half], data.rows(half)
    pooling = calibrate_pooling(*parts, prior, conditions, factor)
    mean, covariance, data = mean[~half], covariance[~half], data.rows(~half)
    scores: dict[str, dict[int, Metrics]] = {}
    for pattern in pooling.patterns:
        by_length = scores[pooling.label(pattern)] = {}
        for groups in groups_by_length(runs_with_pattern(pattern.varies, data, conditions)):
            rule = pooling.rule(measured_rows(data, groups))
            pooled = pool_within_prior(mean[groups], covariance[groups], prior, rule)
            std = np.sqrt(np.diagonal(pooled.covariance, axis1=1, axis2=2))
            # of a Gaussian with the same 90 % interval
            std = std * rule.coverage_factor / Z_90
            by_length[groups.shape[1]] = compute_metrics(
                data.targets[groups[:, 0]], pooled.mean, std, prior.std
            )
    return scores


def runs_with_pattern(
    varies: tuple[bool, ...], data: Dataset, conditions: RunConditions
) -> list[Rows]:
    """Row indices of each run of several rows whose conditions vary as in the pattern.

    A run with a condition between steady and free belongs to no pattern.
    """
    runs = [run for run in data.runs() if len(run) > 1]
    selected = np.zeros(len(runs), bool)
    lengths = np.asarray([len(run) for run in runs], dtype=np.int64)
    for length in np.unique(lengths):  # runs of one length at a time
        same = np.flatnonzero(lengths == length)
        measured = measured_rows(data, np.stack([runs[k] for k in same]))
        variation = conditions.variation(measured, conditions.row_weights(measured))
        selected[same] = np.where(varies, variation >= FREE, variation <= STEADY).all(axis=-1)
    return [runs[k] for k in np.flatnonzero(selected)]


def row_groups(runs: list[Rows], length: int) -> Rows:
    """Row indices (groups, length) of groups within a run, at most a few of each run."""
    groups = [
        run[i : i + length]
        for run in runs
        for i in range(0, min(len(run), MOST_GROUPS_OF_A_RUN * length) - length + 1, length)
    ]
    return np.asarray(groups, dtype=np.int64).reshape(-1, length)


def groups_by_length(runs: list[Rows]) -> Iterator[Rows]:
    """Groups of each number of rows above one, as long as there are enough of them."""
    for length in LENGTHS[1:]:
        groups = row_groups(runs, length)
        if len(groups) < LEAST_GROUPS:
            return
        yield groups


def measured_rows(data: Dataset, rows: Rows) -> dict[str, Floats]:
    """The measured quantities of some rows, or of groups of rows, by name."""
    return {name: values[rows] for name, values in data.measured.items()}
