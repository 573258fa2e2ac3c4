"""Training on few rows: each row is judged by a fit that has not seen its run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student
from sklearn.base import clone

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.estimate import PriorSummary
from training.calibration.recalibration import CalibratedRegressor, recalibrate
from training.dataset import Dataset
from training.ensemble import Ensemble, fuse_members
from training.regressors.gaussian_regressor import FeatureSubset, GaussianHead

MOST_FOLDS = 20  # Fits that leave some runs out

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class LeftOut:
    """Estimates of all rows, each by a fit to the other runs.

    mean, std (n, q): Estimates, in SI units.
    factor (q,): Half-width of the 90 % interval in standard deviations.
    freedom (q,): How many independent errors the n rows are worth: rows of one run share theirs.
    runs: Number of runs; 1 where single rows were left out of one run.
    """

    mean: Floats
    std: Floats
    factor: Floats
    freedom: Floats
    runs: int


@dataclass(frozen=True)
class _Remembered:
    """A regressor that answers with estimates made before, in the order of the rows."""

    mean: Floats
    std: Floats

    def predict(self, features: Floats, return_std: bool = True) -> tuple[Floats, Floats]:
        """The estimates; the features must be those of all rows."""
        return self.mean, self.std


def fit_few_rows(
    regressors: tuple[FeatureSubset, ...],
    rule: str,
    data: Dataset,
    prior: PriorSummary,
    seed: int,
    progress: Progress,
) -> tuple[CalibratedRegressor, list[CalibratedRegressor], list[LeftOut]]:
    """Fit regressors to all rows, and calibrate them by their errors on runs left out.

    The standard deviation is constant: few rows do not determine how it varies.

    regressors: Of the spec; they are fitted in place.
    rule: Fusion rule of several.
    data: All rows (n,); where they are of one run, single rows are left out instead.
    prior: Of the targets, to which estimates are clipped.

    Returns: The estimator, its members, and what was left out, of each member and of the
    estimator, which comes last.
    Raises `InputError` where a regressor does not converge.

    References: Vehtari, Gelman and Gabry, Statistics and Computing 27, 2017 (leave-one-out);
    Barber et al., Annals of Statistics 49(1), 2021 (intervals from the errors of rows left out).
    """
    parts = folds(data, seed)
    members, left = [], []
    for regressor in regressors:
        at = f"fitting {regressor.name} without some runs"
        mean, std = np.empty_like(data.targets), np.empty_like(data.targets)
        for k, out in enumerate(parts):
            progress(at, k, len(parts))
            again = replace(regressor, model=clone(regressor.model))
            _fit(again, data.rows(~out))
            mean[out], std[out] = again.predict(data.features[out], return_std=True)
        progress(at, len(parts), len(parts))
        _fit(regressor, data)
        calibrated = recalibrate(_Remembered(mean, std), data)
        members.append(replace(calibrated, regressor=regressor))
        left.append(_left_out(calibrated, data, prior))
    if len(members) == 1:
        return members[0], members, left
    remembered = [
        replace(m, regressor=_Remembered(part.mean, part.std / m.std_scale))
        for m, part in zip(members, left, strict=True)
    ]
    fused: Ensemble = fuse_members(remembered, rule, data)
    calibrated = recalibrate(fused, data)
    left.append(_left_out(calibrated, data, prior))
    estimator = replace(calibrated, regressor=replace(fused, members=tuple(members)))
    return estimator, members, left


def folds(data: Dataset, seed: int) -> list[NDArray[np.bool_]]:
    """Which rows (n,) each fit leaves out: whole runs, or single rows of a single run."""
    codes = data.run if len(np.unique(data.run)) > 1 else np.arange(len(data))
    names, code = np.unique(codes, return_inverse=True)
    count = min(len(names), MOST_FOLDS)
    fold = np.random.default_rng(seed).permutation(len(names)) % count
    return [fold[code] == k for k in range(count)]


def _fit(regressor: FeatureSubset, data: Dataset) -> None:
    """Fit with one standard deviation for all rows."""
    model: Any = regressor.model
    model.fit_with_validation(
        regressor.select(data.features), data.targets, None, lambda done, total: None
    )
    equal = np.zeros(data.targets.shape[1])  # of the outputs' own spread; calibration scales it
    model.head_ = GaussianHead(model.head_.scaling, equal, equal, model.head_.one_output)
    if not np.isfinite(regressor.predict(data.features)).all():
        raise InputError(f"{regressor.name} did not converge: change its settings in the spec")


def _left_out(calibrated: CalibratedRegressor, data: Dataset, prior: PriorSummary) -> LeftOut:
    mean, std = calibrated.predict(data.features)
    z = (data.targets - np.clip(mean, prior.lower, prior.upper)) / std
    runs = len(np.unique(data.run))
    freedom = np.asarray([_freedom(z[:, k], data.run) for k in range(z.shape[1])])
    # Weibull's quantile: its expected coverage of one more error is the level, for any distribution
    factor = np.quantile(np.abs(z), 0.9, axis=0, method="weibull")
    shared = student.ppf(0.95, freedom) / student.ppf(0.95, len(z) - 1)
    return LeftOut(mean, std, factor * shared, freedom, runs)


def _freedom(z: Floats, run: NDArray[np.int64]) -> float:
    r"""Degrees of freedom of the mean square of errors (n,) that are correlated within a run.

    .. math:: \nu = \frac{n}{1 + (m - 1) \rho^2} - 1

    with the correlation :math:`\rho` of two errors of a run, by analysis of variance, and the
    number m of rows of a run. 1 at least.
    """
    names, code, count = np.unique(run, return_inverse=True, return_counts=True)
    groups, n = len(names), len(z)
    if groups in (1, n):
        return float(n - 1)
    sums = np.bincount(code, weights=z)
    means = sums / count
    within = float(np.sum((z - means[code]) ** 2)) / (n - groups)
    between = float(np.sum(count * means**2)) / groups  # about zero: the mean error counts as well
    m = n / groups
    rho = (between - within) / (between + (m - 1.0) * within)
    return max(n / (1.0 + (m - 1.0) * min(max(rho, 0.0), 1.0) ** 2) - 1.0, 1.0)
