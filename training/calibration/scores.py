"""How good estimates are: error against the prior's spread, likelihood, coverage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Half-widths in standard deviations that hold 50 and 90 % of a Gaussian.
HALF, NINETY = 0.6744897501960817, 1.6448536269514722


@dataclass(frozen=True)
class Score:
    """Per parameter (q,): figures of estimates with a standard deviation."""

    rmse: Floats
    relative: Floats  # rmse / prior's standard deviation
    nll: Floats  # mean negative log density of value / prior std, Gaussian
    cover50: Floats
    cover90: Floats
    rows: int


def scored(truth: Floats, mean: Floats, std: Floats, prior_std: Floats) -> Score:
    """Score of means and standard deviations (n, q) against true values (n, q)."""
    error = truth - mean
    z = np.abs(error) / std
    logs = np.log(std / prior_std)
    return Score(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        relative=np.sqrt(np.mean(error**2, axis=0)) / prior_std,
        nll=np.mean(0.5 * z**2 + logs, axis=0) + 0.5 * np.log(2.0 * np.pi),
        cover50=np.mean(z <= HALF, axis=0),
        cover90=np.mean(z <= NINETY, axis=0),
        rows=len(truth),
    )
