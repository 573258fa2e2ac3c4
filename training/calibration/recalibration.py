"""Uncertainty measured on rows that nobody learned from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import chain, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import (
    PoolingCalibration,
    PriorSummary,
    RunConditions,
    RunPattern,
    pooled,
)
from training.data.dataset import Dataset

Floats = NDArray[np.float64]

#: Readings that the driver chooses.
DRIVEN = ("slip", "load")
#: Numbers of rows at which joining is measured; how many groups that takes, and may come of a run.
LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
LEAST_GROUPS = 50
MOST_OF_A_RUN = 4
#: Share of sound sets that may be taken for contradictory.
RARE = 0.002
#: What a run of each kind varied at most of what was steady, and at least of what was free.
STEADY, FREE = 0.1, 0.5
#: A doubt that no run exceeds, where nothing is known of it.
NO_DOUBT = 1e9
#: Shares of what a row seems to tell that are tried.
WORTHS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.17, 0.12, 0.08, 0.05, 0.03)


@dataclass(frozen=True)
class CalibratedRegressor:
    """A regressor, what its standard deviations are multiplied by, and its errors' correlation."""

    regressor: Any
    widen: Floats  # (q,)
    correlation: Floats  # (q, q) of the errors of one row

    def predict(self, features: Floats) -> tuple[Floats, Floats]:
        """Mean and recalibrated standard deviation, (n, q)."""
        mean, std = self.regressor.predict(features, return_std=True)
        return mean, std * self.widen


def recalibrate(regressor: Any, data: Dataset) -> CalibratedRegressor:
    """Widen so that squared errors are, on the mean, what the variance says."""
    mean, std = regressor.predict(data.features, return_std=True)
    z = (data.targets - mean) / std
    widen = np.sqrt(np.mean(z**2, axis=0))
    return CalibratedRegressor(regressor, widen, np.corrcoef(z.T).reshape(z.shape[1], -1))


def covariances(std: Floats, correlation: Floats) -> Floats:
    """Covariance (n, q, q) from standard deviations (n, q) and one correlation (q, q)."""
    return np.asarray(std[:, :, None] * correlation * std[:, None, :])


def run_conditions_of(data: Dataset) -> RunConditions:
    """What is driven of the readings that are learned from, and how it varies over them."""
    varied = tuple(name for name, values in data.measured.items() if np.ptp(values) > 0.0)
    names = tuple(name for name in varied if name in DRIVEN) or varied[:1]
    chosen = np.stack([data.measured[name] for name in names])
    return RunConditions(names, chosen.min(axis=1), chosen.max(axis=1), chosen.std(axis=1))


def pooling_calibration(
    mean: Floats, covariance: Floats, data: Dataset, prior: PriorSummary, driven: RunConditions
) -> PoolingCalibration:
    """How far joined estimates of several rows stray, against what they claim, by kind of run.

    `mean` (n, q) and `covariance` (n, q, q) are those of the rows of `data`. In a kind of run of
    which there are too few, joining is not trusted to narrow anything.
    """
    rows = groups_of(data.runs(), 1)
    truth = data.targets[rows[:, 0]]
    one = _measured(mean[rows], covariance[rows], truth, prior, np.ones(rows.shape))
    found: dict[tuple[bool, ...], list[_Measured]] = {}
    for varies in product((False, True), repeat=len(driven.names)):
        # rows that are driven alike tell what one tells: of them only the doubt is asked
        worths = WORTHS if any(varies) else WORTHS[:1]
        found[varies] = []
        for groups in long_groups(runs_that(varies, data, driven)):
            fresh = np.stack([driven.fresh(measured_of(data, rows)) for rows in groups])
            parts = (mean[groups], covariance[groups], data.targets[groups[:, 0]], prior, fresh)
            tried = [_measured(*parts, worth) for worth in worths]
            found[varies].append(min(tried, key=lambda entry: entry.loss))
    doubts = [entry.doubt for entry in chain(*found.values())]
    found[(False,) * len(driven.names)] = []
    return PoolingCalibration(
        driven,
        tuple(_kind(varies, [one, *entries]) for varies, entries in found.items()),
        _reach(mean[rows[:, 0]], covariance[rows[:, 0]], truth, prior),
        np.max(doubts, axis=0) if doubts else np.full(2, NO_DOUBT),
    )


def without_pooling(
    mean: Floats, covariance: Floats, data: Dataset, prior: PriorSummary, driven: RunConditions
) -> PoolingCalibration:
    """The same for quantities that differ from row to row: there is nothing to join."""
    rows = groups_of(data.runs(), 1)[:, 0]
    reach = _reach(mean[rows], covariance[rows], data.targets[rows], prior)
    return PoolingCalibration(driven, (), reach, np.full(2, NO_DOUBT))


@dataclass(frozen=True)
class _Measured:
    """What groups of pooled rows show: an entry of a `RunPattern`, and its loss."""

    loss: float
    rows: float
    worth: float
    widening: Floats  # (q,)
    reach: Floats  # (q,)
    doubt: Floats  # (2,)


def _kind(varies: tuple[bool, ...], entries: list[_Measured]) -> RunPattern:
    """Entries whose numbers of rows rise."""
    rising: list[_Measured] = []
    for entry in entries:
        if not rising or entry.rows > 1.02 * rising[-1].rows:
            rising.append(entry)
    columns = {f.name: [getattr(entry, f.name) for entry in rising] for f in fields(_Measured)}
    return RunPattern(varies, *(np.asarray(columns[f.name]) for f in fields(RunPattern)[1:]))


def _measured(
    mean: Floats,
    covariance: Floats,
    truth: Floats,
    prior: PriorSummary,
    fresh: Floats,
    worth: float = 1.0,
) -> _Measured:
    """Groups of rows (groups, m) joined by what is fresh in each row, and a worth.

    Those that are taken for contradictory are answered with the prior, and left out of the rest.
    """
    joint = pooled(mean, covariance, prior, worth * fresh)
    doubt = np.quantile(joint.doubt, 1.0 - RARE, axis=0)
    sound = (joint.doubt <= doubt).all(axis=1)
    std = np.sqrt(np.diagonal(joint.covariance, axis1=1, axis2=2))[sound]
    off = np.abs(truth - np.clip(joint.mean, prior.lower, prior.upper))[sound]
    wide = np.sqrt(np.mean((off / std) ** 2, axis=0))
    return _Measured(
        # negative log likelihood of the widened Gaussian, but for constants
        loss=float(np.mean(np.log(std * wide / prior.std))),
        rows=float(np.exp(np.mean(np.log(fresh.sum(axis=1))))),
        worth=worth,
        widening=wide,
        reach=np.quantile(off / (std * wide), 0.9, axis=0),
        doubt=doubt,
    )


def _reach(mean: Floats, covariance: Floats, truth: Floats, prior: PriorSummary) -> Floats:
    """Half-width (q,) of the 90 % interval of rows that are not joined."""
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    off = np.abs(truth - np.clip(mean, prior.lower, prior.upper))
    return np.asarray(np.quantile(off / std, 0.9, axis=0))


def runs_that(
    varies: tuple[bool, ...], data: Dataset, driven: RunConditions
) -> list[NDArray[np.int64]]:
    """Row numbers of each run of several rows that varied so; runs between kinds are left out."""
    found = []
    for run in data.runs():
        measured = measured_of(data, run)
        varied = driven.varied(measured, driven.fresh(measured))
        if len(run) > 1 and np.where(varies, varied >= FREE, varied <= STEADY).all():
            found.append(run)
    return found


def groups_of(runs: list[NDArray[np.int64]], length: int) -> NDArray[np.int64]:
    """Rows (groups, length) of one soil each; a run gives at most a few, lest it count too much."""
    found = [
        run[i : i + length]
        for run in runs
        for i in range(0, min(len(run), MOST_OF_A_RUN * length) - length + 1, length)
    ]
    return np.asarray(found, dtype=np.int64).reshape(-1, length)


def long_groups(runs: list[NDArray[np.int64]]) -> Iterator[NDArray[np.int64]]:
    """Groups of each number of rows above one, as long as there are enough."""
    for length in LENGTHS[1:]:
        groups = groups_of(runs, length)
        if len(groups) < LEAST_GROUPS:
            return
        yield groups


def measured_of(data: Dataset, rows: NDArray[np.int64]) -> dict[str, Floats]:
    """What was measured in some rows."""
    return {name: values[rows] for name, values in data.measured.items()}
