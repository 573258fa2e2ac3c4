"""The radial basis kernel, its natural width, and the target of a log-variance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Expectation of the logarithm of a squared standard normal variable.
LOG_CHI2 = -1.2703628454614782
#: Share of their mean that is added to squared residuals, so that their logarithms are finite.
SQUARE_FLOOR = 1e-4


def rbf(a: Floats, b: Floats, width: float) -> Floats:
    r"""Kernel matrix (len(a), len(b)), `exp(-|a - b|^2 / (2 width^2))`."""
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :] - 2.0 * (a @ b.T)
    return np.asarray(np.exp(-np.maximum(squared, 0.0) / (2.0 * width * width)))


def log_squared_residuals(residual: Floats) -> Floats:
    """Targets (n, q) for a log-variance: logarithms of squared residuals, corrected for bias."""
    square = residual**2
    floor = SQUARE_FLOOR * square.mean(axis=0) + 1e-300
    return np.asarray(np.log(square + floor) - LOG_CHI2)


def median_distance(x: Floats, seed: int = 0) -> float:
    """Median distance between rows (n, d), of at most 400 of them: the unit of kernel widths."""
    sample = x[np.random.default_rng(seed).permutation(len(x))[:400]]
    distance = np.sqrt(((sample[:, None, :] - sample[None, :, :]) ** 2).sum(axis=-1))
    pairs = np.triu_indices(len(sample), 1)
    median = float(np.median(distance[pairs])) if len(sample) > 1 else 1.0
    return median if median > 0.0 else 1.0
