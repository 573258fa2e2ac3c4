"""Recalibration of a regressor's standard deviations on rows that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.data.dataset import Dataset

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CalibratedRegressor:
    """A fitted regressor with calibrated standard deviations.

    Attributes
    ----------
    regressor : FeatureSubset, Ensemble or scikit-learn regressor
        Anything with `predict(features, return_std=True)`.
    std_scale : ndarray, shape (q,)
        Factor on its standard deviations.
    correlation : ndarray, shape (q, q)
        Correlation between the errors of the q outputs in one row.
    """

    regressor: Any
    std_scale: Floats
    correlation: Floats

    def predict(self, features: Floats) -> tuple[Floats, Floats]:
        """Mean and recalibrated standard deviation, (n, q), of features (n, d)."""
        mean, std = self.regressor.predict(features, return_std=True)
        return mean, std * self.std_scale


def recalibrate(regressor: Any, data: Dataset) -> CalibratedRegressor:
    r"""Scale standard deviations so that the squared standardised errors of `data` average to 1.

    .. math:: s_k^2 = \frac{1}{n} \sum_i (y_{ik} - \mu_{ik})^2 / \sigma_{ik}^2
    """
    mean, std = regressor.predict(data.features, return_std=True)
    z = (data.targets - mean) / std
    std_scale = np.sqrt(np.mean(z**2, axis=0))
    return CalibratedRegressor(regressor, std_scale, np.corrcoef(z.T).reshape(z.shape[1], -1))


def covariance_matrices(std: Floats, correlation: Floats) -> Floats:
    """Covariances (n, q, q) from standard deviations (n, q) and one correlation (q, q)."""
    return np.asarray(std[:, :, None] * correlation * std[:, None, :])
