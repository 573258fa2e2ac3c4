"""What a file has of its errors on rows left out, so that it can be fused with others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.gaussian_pooling import PoolingCalibration, RunConditions
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.quantities import Z_90
from training.calibration.recalibration import Metrics, compute_metrics
from training.calibration.row_pooling import LEAST_GROUPS, Rows, row_groups, runs_with_pattern
from training.dataset import Dataset

MOST_ROWS = 2000  # Most rows that a file carries
#: Numbers of repeated readings at which the error of their mean is measured.
REPEATS = (1, 2, 4, 8, 16)
SAME_TARGET = 0.01  # A target counts as the same in all rows of a run up to this share of its range


def carry_errors(
    mean: Floats, std: Floats, pooling: PoolingCalibration, data: Dataset, prior_std: Floats
) -> tuple[PoolingCalibration, dict[int, Metrics]]:
    """The pooling calibration with the errors of rows, and metrics of repeated readings.

    Metrics are those of half of the runs, with the errors of the others.

    mean, std (n, q): Estimates of the rows of `data` by fits that have not seen them.
    """
    conditions, factor = pooling.conditions, pooling.single_row_coverage_factor
    held_out = measure_held_out(mean, std, data, conditions, factor)
    half = data.run % 2 == 0
    known = measure_held_out(mean[half], std[half], data.rows(half), conditions, factor)
    scores = score_repeats(known, mean[~half], std[~half], data.rows(~half), conditions, prior_std)
    return replace(pooling, held_out=held_out), scores


def measure_held_out(
    mean: Floats, std: Floats, data: Dataset, conditions: RunConditions, coverage_factor: Floats
) -> HeldOutErrors:
    """The errors of a file on rows that it has not seen, and of repeated readings of one soil.

    Repeats are runs at one slip and load; without `LEAST_GROUPS` of them, repeated readings count
    as one.

    mean, std (n, q): Estimates of the rows of `data`.
    conditions: Of all rows.
    coverage_factor (q,): Half-width of the 90 % interval of one reading, in standard deviations.
    """
    first = np.asarray([run[0] for run in data.runs()])
    if len(first) > MOST_ROWS:
        first = first[np.linspace(0, len(first) - 1, MOST_ROWS).astype(int)]
    first = first[np.argsort(data.row[first])]
    repeats, size, factor = [1], [np.ones(mean.shape[1])], [coverage_factor]
    runs = steady_runs(data, conditions)
    longest = row_groups([], 1)
    one = _size_and_quantile(row_groups(runs, 1), data.targets, mean, std)
    for count in REPEATS[1:]:
        groups = row_groups(runs, count)
        if len(groups) < LEAST_GROUPS:
            break
        many = _size_and_quantile(groups, data.targets, mean, std)
        longest = groups
        repeats.append(count)
        size.append(np.minimum(many[0] / one[0], size[-1]))
        factor.append(coverage_factor * (many[1] / many[0]) / (one[1] / one[0]))
    number = np.asarray([data.row[group].min() for group in longest], dtype=np.int64)
    order = np.argsort(number)
    number, longest = number[order], longest[order]
    found = {
        "rows": data.row[first].tolist(),
        "truth": data.targets[first].tolist(),
        "mean": mean[first].tolist(),
        "std": std[first].tolist(),
        "average_rows": number.tolist(),
        "average_truth": data.targets[longest[:, 0]].tolist(),
        "average_mean": mean[longest].mean(axis=1).tolist(),
        "average_std": std[longest].mean(axis=1).tolist(),
        "repeats": repeats,
        "repeat_std": size,
        "repeat_coverage_factor": factor,
    }
    return HeldOutErrors.of(HeldOutErrors.of(found).entry())  # as it is read back from the file


def score_repeats(
    held_out: HeldOutErrors,
    mean: Floats,
    std: Floats,
    data: Dataset,
    conditions: RunConditions,
    prior_std: Floats,
) -> dict[int, Metrics]:
    """Metrics of the mean of repeated readings, by their number, on rows of `data`."""
    runs = steady_runs(data, conditions)
    scores = {}
    for count in REPEATS:
        groups = row_groups(runs, count)
        if len(groups) < LEAST_GROUPS:
            break
        size, factor = held_out.repeated(count)
        claimed = std[groups].mean(axis=1) * size * factor / Z_90
        truth = data.targets[groups[:, 0]]
        scores[count] = compute_metrics(truth, mean[groups].mean(axis=1), claimed, prior_std)
    return scores


def steady_runs(data: Dataset, conditions: RunConditions) -> list[Rows]:
    """Row indices of each run of several rows at one value of all conditions and targets."""
    steady = runs_with_pattern((False,) * len(conditions.names), data, conditions)
    width = SAME_TARGET * (data.upper - data.lower)
    return [run for run in steady if (np.ptp(data.targets[run], axis=0) <= width).all()]


def _size_and_quantile(
    groups: Rows, truth: Floats, mean: Floats, std: Floats
) -> tuple[Floats, Floats]:
    """Root mean square and 90 % quantile (q,) of the error of a group's mean over its mean std."""
    if not len(groups):
        ones = np.ones(mean.shape[1])
        return ones, ones
    z = np.abs(truth[groups[:, 0]] - mean[groups].mean(axis=1)) / std[groups].mean(axis=1)
    return np.sqrt(np.mean(z**2, axis=0)), np.asarray(np.quantile(z, 0.9, axis=0))
