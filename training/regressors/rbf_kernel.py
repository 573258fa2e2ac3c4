"""The radial basis kernel, and ridge regression with a bias by eigenvalues."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Expectation of the logarithm of a squared standard normal number.
LOG_CHI2 = -1.2703628454614782
#: Squared residuals are kept from zero by this share of their mean, before logarithms.
LEAST_SQUARE = 1e-4


def rbf(a: Floats, b: Floats, width: float) -> Floats:
    r"""Kernel matrix (len(a), len(b)), `exp(-|a - b|^2 / (2 width^2))`."""
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :] - 2.0 * (a @ b.T)
    return np.asarray(np.exp(-np.maximum(squared, 0.0) / (2.0 * width * width)))


def log_squares(residual: Floats) -> Floats:
    """Targets (n, q) for a log-variance: unbiased logs of squared residuals of unit variance."""
    square = residual**2
    floor = LEAST_SQUARE * square.mean(axis=0) + 1e-300
    return np.asarray(np.log(square + floor) - LOG_CHI2)


def median_distance(x: Floats, seed: int = 0) -> float:
    """Median distance between rows, the natural unit of kernel widths."""
    some = x[np.random.default_rng(seed).permutation(len(x))[:400]]
    apart = np.sqrt(((some[:, None, :] - some[None, :, :]) ** 2).sum(axis=-1))
    middle = float(np.median(apart[np.triu_indices(len(some), 1)])) if len(some) > 1 else 1.0
    return middle if middle > 0.0 else 1.0
