"""A fitted pair of kernel expansions: of the mean and of the log-variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: Standardised inputs (n, d) and outputs (n, q).
Rows = tuple[Floats, Floats]

#: With fewer validation rows hyperparameters are selected by leave-one-out.
LEAST_VALIDATION_ROWS = 200
#: Most validation rows that they are selected on.
MOST_VALIDATION_ROWS = 4000


#: Kernel width, gammas and mean squared errors of each width that was searched.
Search = list[tuple[float, Floats, Floats]]


@dataclass(frozen=True)
class Expansion:
    """What a solution gives to its regressor, in standardised units.

    Attributes
    ----------
    solution : str
        "exact" or "fixed-size".
    centres : ndarray, shape (m, d)
    width, gamma : float
    alpha, bias : ndarray, shapes (m, q) and (q,)
        Of the mean.
    log_variance_alpha, log_variance_bias : ndarray, shapes (m, q) and (q,)
        Of the log-variance.
    log_variances : ndarray, shape (k, q)
        On training rows.
    residual : ndarray, shape (n, q)
        Leave-one-out residuals of the training rows.
    search : Search
        What width and gamma were selected from; the selected width is the last.
    """

    solution: str
    centres: Floats
    width: float
    gamma: float
    alpha: Floats
    bias: Floats
    log_variance_alpha: Floats
    log_variance_bias: Floats
    log_variances: Floats
    residual: Floats
    search: Search


def by_error(search: Search) -> Search:
    """The same with the width of the least error last."""
    return sorted(search, key=lambda entry: -float(entry[2].min()))


def usable_validation(validation: Rows | None) -> Rows | None:
    """The validation rows to select on, or None where there are too few."""
    if validation is None or len(validation[0]) < LEAST_VALIDATION_ROWS:
        return None
    return validation[0][:MOST_VALIDATION_ROWS], validation[1][:MOST_VALIDATION_ROWS]
