"""Fits to all rows, calibrated by the errors of fits that have not seen the rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.gaussian_product import PriorSummary
from training.calibration.recalibration import (
    CalibratedRegressor,
    Metrics,
    calibrated,
    compute_metrics,
)
from training.dataset import Dataset
from training.ensemble import fuse_members
from training.regressors.gaussian_regressor import FeatureSubset, few_groups
from training.spec import Spec

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class LeftOut:
    """Estimates of all rows, each by a fit without its run.

    Where all rows are of one run, single rows are left out instead.

    mean, std (n, q): Estimates, in SI units.
    factor (q,): Half-width of the 90 % interval in standard deviations.
    freedom (q,): How many independent errors the n rows are worth: rows of one run share theirs.
    runs: Number of runs; 1 where single rows were left out of one run.
    few: Whether there are too few runs to tell how the standard deviation varies.
    """

    mean: Floats
    std: Floats
    factor: Floats
    freedom: Floats
    runs: int
    few: bool


@dataclass(frozen=True)
class CrossFit:
    """Fitted and calibrated regressors, the rows left out of them, and their metrics."""

    estimator: CalibratedRegressor  # the only regressor, or the ensemble of all
    members: tuple[CalibratedRegressor, ...]
    left_out: LeftOut  # by the estimator
    #: of single rows: of each member, and of the estimator
    scores: dict[str, Metrics]


def cross_fit(spec: Spec, data: Dataset, prior: PriorSummary, progress: Progress) -> CrossFit:
    """Fit regressors to all rows, and calibrate and fuse them by their errors on runs left out.

    With few runs the standard deviation is constant: they do not determine how it varies.

    spec: Its regressors are fitted in place.

    Raises `InputError` where a regressor does not converge.

    References: Stone, J. Royal Statistical Society B 36, 1974 (cross-validation); Barber et al.,
    Annals of Statistics 49(1), 2021 (intervals from the errors of rows left out).
    """
    groups = data.run if len(np.unique(data.run)) > 1 else np.arange(len(data))
    few = few_groups(groups)
    some = np.arange(len(data))
    if not few:  # errors of the rows of a run are correlated
        some = np.sort(np.concatenate([run[:2] for run in data.runs()]))
    truth, scores = data.targets[some], {}
    members, means, stds = [], [], []
    for regressor in spec.regressors:
        mean, std = _fit(regressor, data, groups, few, progress)
        member = calibrated(regressor, mean[some], std[some], truth)
        members.append(member)
        means.append(mean)
        stds.append(std * member.std_scale)
        scores[regressor.name] = compute_metrics(truth, mean[some], stds[-1][some], prior.std)
    estimator, mean, std = members[0], means[0], stds[0]
    if len(members) > 1:
        own_means, own_stds = ([part[some] for part in own] for own in (means, stds))
        fused = fuse_members(members, np.stack(own_means), np.stack(own_stds), truth)
        estimator = calibrated(fused, *fused.combine(own_means, own_stds), truth)
        mean, std = fused.combine(means, stds)
        std = std * estimator.std_scale
    scores["estimator"] = compute_metrics(truth, mean[some], std[some], prior.std)
    return CrossFit(estimator, tuple(members), _left_out(mean, std, data, some, prior, few), scores)


def _fit(
    regressor: FeatureSubset,
    data: Dataset,
    groups: NDArray[np.int64],
    few: bool,
    progress: Progress,
) -> tuple[Floats, Floats]:
    """Fit in place; estimates (n, q) of all rows without their groups, and standard deviations."""
    progress(f"fitting {regressor.name}", 0, 1)
    mean, std = regressor.fit_left_out(
        data.features,
        data.targets,
        groups,
        lambda done, total: progress(f"fitting {regressor.name}", done, total),
        few,
    )
    if not np.isfinite([mean, std, regressor.predict(data.features)]).all():
        raise InputError(f"{regressor.name} did not converge: change its settings in the spec")
    return mean, std


def _left_out(
    mean: Floats,
    std: Floats,
    data: Dataset,
    some: NDArray[np.int64],
    prior: PriorSummary,
    few: bool,
) -> LeftOut:
    z = ((data.targets - np.clip(mean, prior.lower, prior.upper)) / std)[some]
    run = data.run[some]
    freedom = np.asarray([_freedom(z[:, k], run) for k in range(z.shape[1])])
    # Weibull's quantile: its expected coverage of one more error is the level, for any distribution
    factor = np.quantile(np.abs(z), 0.9, axis=0, method="weibull")
    shared = student.ppf(0.95, freedom) / student.ppf(0.95, len(z) - 1)
    return LeftOut(mean, std, factor * shared, freedom, len(np.unique(run)), few)


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
