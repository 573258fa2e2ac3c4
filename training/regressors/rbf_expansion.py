"""The radial basis kernel, and a fitted pair of expansions on it: mean and log-variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats

Rows = tuple[Floats, Floats]

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


def median_distance(x: Floats) -> float:
    """Median distance between rows (n, d), of at most 400 of them: the unit of kernel widths."""
    sample = x[np.random.default_rng(0).permutation(len(x))[:400]]
    distance = np.sqrt(((sample[:, None, :] - sample[None, :, :]) ** 2).sum(axis=-1))
    pairs = np.triu_indices(len(sample), 1)
    median = float(np.median(distance[pairs])) if len(sample) > 1 else 1.0
    return median if median > 0.0 else 1.0


#: Standardised inputs (n, d) and outputs (n, q).

#: With fewer validation rows hyperparameters are selected by leave-one-out.
LEAST_VALIDATION_ROWS = 200
MOST_VALIDATION_ROWS = 4000  # Most validation rows that they are selected on


#: Kernel width, gammas and mean squared errors of each width that was searched.
Search = list[tuple[float, Floats, Floats]]


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
    log_variances: Floats  # (k, q) on training rows
    residual: Floats  # (n, q) leave-one-out residuals of the training rows
    search: Search  # what width and gamma were selected from; the selected width is the last


def by_error(search: Search) -> Search:
    """The same with the width of the least error last."""
    return sorted(search, key=lambda entry: -float(entry[2].min()))


def usable_validation(validation: Rows | None) -> Rows | None:
    """The validation rows to select on, or None where there are too few."""
    if validation is None or len(validation[0]) < LEAST_VALIDATION_ROWS:
        return None
    return validation[0][:MOST_VALIDATION_ROWS], validation[1][:MOST_VALIDATION_ROWS]
