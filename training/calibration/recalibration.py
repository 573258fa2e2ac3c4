"""Metrics of estimates with a standard deviation, and its recalibration by rows left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.quantities import Z_50, Z_90
from training.dataset import Dataset


@dataclass(frozen=True)
class Metrics:
    """Metrics of each of q quantities, (q,)."""

    #: root mean square error, in SI units and in standard deviations of the prior
    rmse: Floats
    relative: Floats
    #: mean negative log density, Gaussian, of the value in standard deviations of the prior
    nll: Floats
    #: share of the true values within the Gaussian 50 and 90 % intervals
    cover50: Floats
    cover90: Floats
    rows: int  # number of rows that they were measured on


def compute_metrics(truth: Floats, mean: Floats, std: Floats, prior_std: Floats) -> Metrics:
    """Metrics of means and standard deviations (n, q) against true values (n, q)."""
    error = truth - mean
    z = np.abs(error) / std
    logs = np.log(std / prior_std)
    return Metrics(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        relative=np.sqrt(np.mean(error**2, axis=0)) / prior_std,
        nll=np.mean(0.5 * z**2 + logs, axis=0) + 0.5 * np.log(2.0 * np.pi),
        cover50=np.mean(z <= Z_50, axis=0),
        cover90=np.mean(z <= Z_90, axis=0),
        rows=len(truth),
    )


@dataclass(frozen=True)
class CalibratedRegressor:
    """A fitted regressor with calibrated standard deviations."""

    regressor: Any  # anything with `predict(features, return_std=True)`
    std_scale: Floats  # (q,) factor on its standard deviations
    correlation: Floats  # (q, q) correlation between the errors of the q outputs in one row

    def predict(self, features: Floats) -> tuple[Floats, Floats]:
        """Mean and recalibrated standard deviation, (n, q), of features (n, d)."""
        mean, std = self.regressor.predict(features, return_std=True)
        return mean, std * self.std_scale


def calibrated(regressor: Any, mean: Floats, std: Floats, truth: Floats) -> CalibratedRegressor:
    r"""Scale standard deviations so that squared standardised errors average to 1.

    .. math:: s_k^2 = \frac{1}{n} \sum_i (y_{ik} - \mu_{ik})^2 / \sigma_{ik}^2

    regressor: Fitted.
    mean, std, truth (n, q): Its estimates of rows by fits that have not seen them, and true values.
    """
    z = (truth - mean) / std
    std_scale = np.sqrt(np.mean(z**2, axis=0))
    return CalibratedRegressor(regressor, std_scale, np.corrcoef(z.T).reshape(z.shape[1], -1))


MOST_ROWS = 2000  # Most rows whose errors a file carries


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
