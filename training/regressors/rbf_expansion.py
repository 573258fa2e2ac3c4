"""The radial basis kernel, and a fitted pair of expansions on it: mean and log-variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats

LOG_CHI2 = -1.2703628454614782  # Expectation of the logarithm of a squared standard normal variable
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


#: Steps of Fisher scoring after the fit to logarithms, and the largest squared error over variance.
SCORING_STEPS, MOST_SQUARE = 2, 20.0


def scored_response(residual: Floats, log_variance: Floats) -> Floats:
    r"""Working response (n, q) of a step of Fisher scoring for a log-variance :math:`\eta`.

    .. math:: u = \eta + r^2 e^{-\eta} - 1

    Its least squares fit is a step towards the largest Gaussian likelihood, whose information on
    a log-variance is the same for all rows. Logarithms of squared residuals, from which the steps
    start, have 2.5 times its variance, and a bias where errors are not Gaussian.

    References: Smyth, J. Royal Statistical Society B 51(1), 1989.
    """
    square = np.minimum(residual**2 * np.exp(-log_variance), MOST_SQUARE)
    return np.asarray(log_variance + square - 1.0)


def median_distance(x: Floats) -> float:
    """Median distance between rows (n, d), of at most 400 of them: the unit of kernel widths."""
    sample = x[np.random.default_rng(0).permutation(len(x))[:400]]
    distance = np.sqrt(((sample[:, None, :] - sample[None, :, :]) ** 2).sum(axis=-1))
    pairs = np.triu_indices(len(sample), 1)
    median = float(np.median(distance[pairs])) if len(sample) > 1 else 1.0
    return median if median > 0.0 else 1.0


@dataclass(frozen=True)
class Expansion:
    """What a solution gives to its regressor, in standardised units."""

    solution: str  # "exact" or "fixed-size"
    centres: Floats  # (m, d)
    width: float
    gamma: float
    #: (m, q) and (q,) of the mean
    alpha: Floats
    bias: Floats
    #: (m, q) and (q,) of the log-variance
    log_variance_alpha: Floats
    log_variance_bias: Floats
    #: (n, q) mean and log-variance of the training rows, each by a solution without its group
    left_out: tuple[Floats, Floats]
