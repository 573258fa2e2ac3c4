"""Uncertainty measured on rows that nobody learned from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.estimate import Known, Together, joined
from training.dataset import Dataset

Floats = NDArray[np.float64]

#: Readings that the driver chooses.
DRIVEN = ("slip", "load")
#: Numbers of rows at which joining is measured; how many groups that takes, and may come of a run.
LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
LEAST_GROUPS = 50
MOST_OF_A_RUN = 4
#: Share of sound sets that may be taken for contradictory.
RARE = 0.005
#: Shares of what a row seems to tell that are tried.
WORTHS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.17, 0.12, 0.08, 0.05, 0.03)


@dataclass(frozen=True)
class Calibrated:
    """A regressor, what its standard deviations are multiplied by, and its errors' correlation."""

    regressor: Any
    widen: Floats  # (q,)
    correlation: Floats  # (q, q) of the errors of one row

    def predict(self, features: Floats) -> tuple[Floats, Floats]:
        """Mean and recalibrated standard deviation, (n, q)."""
        mean, std = self.regressor.predict(features, return_std=True)
        return mean, std * self.widen


def calibrated(regressor: Any, data: Dataset) -> Calibrated:
    """Widen so that squared errors are, on the mean, what the variance says."""
    mean, std = regressor.predict(data.features, return_std=True)
    z = (data.targets - mean) / std
    widen = np.sqrt(np.mean(z**2, axis=0))
    return Calibrated(regressor, widen, np.corrcoef(z.T).reshape(z.shape[1], -1))


def covariances(std: Floats, correlation: Floats) -> Floats:
    """Covariance (n, q, q) from standard deviations (n, q) and one correlation (q, q)."""
    return np.asarray(std[:, :, None] * correlation * std[:, None, :])


def together(mean: Floats, covariance: Floats, data: Dataset, prior: Known) -> Together:
    """How far joined estimates of several rows stray, against what they claim.

    `mean` (n, q) and `covariance` (n, q, q) are those of the rows of `data`. Where it has no runs
    of several rows, joining is not trusted to narrow anything.
    """
    runs = runs_of(data)
    found = []
    for length in LENGTHS:
        groups = groups_of(runs, length)
        if len(groups) < LEAST_GROUPS:
            break
        truth = data.targets[groups[:, 0]]
        tried = [
            _measured(mean[groups], covariance[groups], truth, prior, length, worth)
            for worth in (WORTHS if length > 1 else WORTHS[:1])
        ]
        found.append((length, *min(tried, key=lambda entry: entry[0])[1:]))
    if len(found) == 1:  # nothing is known of joining: it narrows nothing
        _, _, widening, reach, doubt = found[0]
        found.append((LENGTHS[-1], 1.0 / LENGTHS[-1], widening, reach, np.full_like(doubt, 1e9)))
    return Together(*(np.asarray(part, dtype=float) for part in zip(*found, strict=True)))


def _measured(
    mean: Floats, covariance: Floats, truth: Floats, prior: Known, length: int, worth: float
) -> tuple[float, float, Floats, Floats, Floats]:
    """Loss, worth, widening (q,), reach (q,) and doubt (2,) of groups of rows joined so."""
    joint = joined(mean, covariance, prior, worth)
    m, c = (joint.mean, joint.covariance) if length > 1 else (mean[:, 0], covariance[:, 0])
    std = np.sqrt(np.diagonal(c, axis1=1, axis2=2))
    off = np.abs(truth - np.clip(m, prior.lower, prior.upper))
    wide = np.sqrt(np.mean((off / std) ** 2, axis=0)) if length > 1 else np.ones(std.shape[1])
    reach = np.quantile(off / (std * wide), 0.9, axis=0)
    # negative log likelihood of the widened Gaussian, but for constants
    loss = float(np.mean(np.log(std * wide / prior.std)))
    return loss, worth, wide, reach, np.quantile(joint.doubt, 1.0 - RARE, axis=0)


def groups_of(runs: list[NDArray[np.int64]], length: int) -> NDArray[np.int64]:
    """Rows (groups, length) of one soil each; a run gives at most a few, lest it count too much."""
    found = [
        run[i : i + length]
        for run in runs
        for i in range(0, min(len(run), MOST_OF_A_RUN * length) - length + 1, length)
    ]
    return np.asarray(found, dtype=np.int64).reshape(-1, length)


def runs_of(data: Dataset) -> list[NDArray[np.int64]]:
    """Row numbers of each run."""
    order = np.argsort(data.run, kind="stable")
    ends = np.flatnonzero(np.diff(data.run[order])) + 1
    return [np.asarray(part) for part in np.split(order, ends)]
