"""Metrics of estimators, fusion rules and pooled rows on rows that nothing was calibrated on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.estimate_fusion import RULES
from soilml.onboard.estimate import PriorSummary
from soilml.onboard.gaussian_pooling import PoolingCalibration, pool_within_prior
from soilml.quantities import Z_90
from training.calibration.metrics import Metrics, compute_metrics
from training.calibration.recalibration import (
    CalibratedRegressor,
    covariance_matrices,
    recalibrate,
)
from training.calibration.row_pooling import groups_by_length, measured_rows, runs_with_pattern
from training.data.dataset import Dataset
from training.ensemble import fuse_members

Floats = NDArray[np.float64]


def score(estimator: CalibratedRegressor, data: Dataset, prior_std: Floats) -> Metrics:
    """Metrics of single rows."""
    return compute_metrics(data.targets, *estimator.predict(data.features), prior_std)


def score_rules(
    members: list[CalibratedRegressor],
    first: Dataset,
    second: Dataset,
    third: Dataset,
    prior_std: Floats,
) -> dict[str, Metrics]:
    """Metrics of every fusion rule, before and after recalibration."""
    scores = {}
    for rule in RULES:
        ensemble = fuse_members(members, rule, first)
        claimed = ensemble.predict(third.features)
        scores[f"{rule}, as claimed"] = compute_metrics(third.targets, *claimed, prior_std)
        scores[f"{rule}, recalibrated"] = score(recalibrate(ensemble, second), third, prior_std)
    return scores


def score_pooling(
    estimator: CalibratedRegressor, pooling: PoolingCalibration, data: Dataset, prior: PriorSummary
) -> dict[str, dict[int, Metrics]]:
    """Metrics of pooled rows by pattern and number of rows, on runs not used for calibration."""
    mean, std = estimator.predict(data.features)
    covariance = covariance_matrices(std, estimator.correlation)
    scores: dict[str, dict[int, Metrics]] = {}
    for pattern in pooling.patterns:
        by_length = scores[pooling.label(pattern)] = {}
        runs = runs_with_pattern(pattern.varies, data, pooling.conditions)
        for groups in groups_by_length(runs):
            rule = pooling.rule(measured_rows(data, groups))
            pooled = pool_within_prior(mean[groups], covariance[groups], prior, rule)
            std = np.sqrt(np.diagonal(pooled.covariance, axis1=1, axis2=2))
            # of a Gaussian with the same 90 % interval
            std = std * rule.coverage_factor / Z_90
            by_length[groups.shape[1]] = compute_metrics(
                data.targets[groups[:, 0]], pooled.mean, std, prior.std
            )
    return scores
