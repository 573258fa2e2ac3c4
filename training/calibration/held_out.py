"""What a file has of its errors on rows left out, so that it can be fused with others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.onboard.held_out_errors import HeldOutErrors
from training.calibration.training_domain import OPERATING_CONDITIONS
from training.dataset import Dataset

Rows = NDArray[np.int64]
MOST_ROWS = 2000  # Most rows that a file carries
#: Numbers of repeated readings by which the share of their errors in common is measured.
REPEATS = (2, 4, 8, 16)
#: Least number of groups for that, and most groups of one run, so that none dominates.
LEAST_GROUPS, MOST_GROUPS_OF_A_RUN = 50, 4
#: An operating condition counts as steady in a run whose standard deviation of it is up to this
#: share of that of all rows.
STEADY = 0.2
SAME_TARGET = 0.01  # A target counts as the same in all rows of a run up to this share of its range


def measure_held_out(mean: Floats, std: Floats, data: Dataset) -> HeldOutErrors:
    """The errors of a file on rows that it has not seen, one of each run.

    mean, std (n, q): Estimates of the rows of `data`.
    """
    first = np.asarray([run[0] for run in data.runs()])
    if len(first) > MOST_ROWS:
        first = first[np.linspace(0, len(first) - 1, MOST_ROWS).astype(int)]
    first = first[np.argsort(data.row[first])]
    found = {
        "rows": data.row[first].tolist(),
        "truth": data.targets[first].tolist(),
        "mean": mean[first].tolist(),
        "std": std[first].tolist(),
    }
    return HeldOutErrors.of(HeldOutErrors.of(found).entry())  # as it is read back from the file


def common_share(mean: Floats, std: Floats, data: Dataset) -> Floats:
    """Share (q,) of the error variance that readings of one soil at one slip and load share.

    From the mean of m readings, whose error has the share c + (1 - c) / m of the variance of one,
    with the largest m for which there are `LEAST_GROUPS`; 1 where there are none.

    mean, std (n, q): Estimates of the rows of `data`.
    """
    share, runs = np.ones(mean.shape[1]), steady_runs(data)
    for m in REPEATS:
        groups = row_groups(runs, m)
        if len(groups) < LEAST_GROUPS:
            break
        sizes = [_size(own, data.targets, mean, std) for own in (groups, row_groups(runs, 1))]
        share = np.clip((m * (sizes[0] / sizes[1]) ** 2 - 1.0) / (m - 1.0), 0.0, 1.0)
    return share


def steady_runs(data: Dataset) -> list[Rows]:
    """Row indices of each run of several rows at one value of all conditions and targets."""
    conditions = [data.measured[name] for name in OPERATING_CONDITIONS if name in data.measured]
    most = [STEADY * values.std() for values in conditions]
    width = SAME_TARGET * (data.upper - data.lower)
    return [
        run
        for run in data.runs()
        if len(run) > 1
        and all(own[run].std() <= limit for own, limit in zip(conditions, most, strict=True))
        and (np.ptp(data.targets[run], axis=0) <= width).all()
    ]


def row_groups(runs: list[Rows], length: int) -> Rows:
    """Row indices (groups, length) of groups within a run, at most a few of each run."""
    groups = [
        run[i : i + length]
        for run in runs
        for i in range(0, min(len(run), MOST_GROUPS_OF_A_RUN * length) - length + 1, length)
    ]
    return np.asarray(groups, dtype=np.int64).reshape(-1, length)


def _size(groups: Rows, truth: Floats, mean: Floats, std: Floats) -> Floats:
    """Root mean square (q,) of the error of a group's mean over its mean std."""
    z = (truth[groups[:, 0]] - mean[groups].mean(axis=1)) / std[groups].mean(axis=1)
    return np.asarray(np.sqrt(np.mean(z**2, axis=0)))
