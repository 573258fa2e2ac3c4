"""Metrics of estimates with a standard deviation: error, likelihood and coverage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import Z_50, Z_90

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """Metrics of each of q quantities, (q,).

    Attributes
    ----------
    rmse, relative : ndarray
        Root mean square error, in SI units and in standard deviations of the prior.
    nll : ndarray
        Mean negative log density, Gaussian, of the value in standard deviations of the prior.
    cover50, cover90 : ndarray
        Share of the true values within the Gaussian 50 and 90 % intervals.
    rows : int
        Number of rows that they were measured on.
    """

    rmse: Floats
    relative: Floats
    nll: Floats
    cover50: Floats
    cover90: Floats
    rows: int


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
