"""Fusion of several estimates of one quantity.

The rule depends on the correlation of the errors. Estimates from different sensors or times have
independent errors: inverse-variance weights are optimal. Regressors of the same measurement have
correlated errors (0.8 and more): inverse-variance weights then understate the variance by far, and
a rule that uses the correlation is needed.

All rules take `mean` and `std` of shape (m, ...) for m estimators and return a `FusedEstimate`.
They raise `InputError` for a standard deviation that is not positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from soilml.errors import InputError
from soilml.onboard.set_contract import Floats

RIDGE = 1e-9  # Ridge that keeps the correlation matrix of two equal estimators invertible


@dataclass(frozen=True)
class FusedEstimate:
    """Fused mean and standard deviation (...), and the weights (m, ...) that sum to one."""

    mean: Floats
    std: Floats
    weights: Floats


def inverse_variance(mean: Floats, std: Floats) -> FusedEstimate:
    r"""Inverse-variance weights, optimal for independent errors.

    .. math:: w_i = \sigma_i^{-2} / \sum_j \sigma_j^{-2}, \quad \sigma^2 = 1 / \sum_j \sigma_j^{-2}

    Not for correlated errors, whose variance it understates.

    References: Comin and Saaj 2017, eq. 26, for two.
    """
    _check(std)
    information = std**-2.0
    weights = information / information.sum(axis=0)
    return FusedEstimate((weights * mean).sum(axis=0), information.sum(axis=0) ** -0.5, weights)


def pairwise(mean: Floats, std: Floats) -> FusedEstimate:
    r"""Mean of the two-sensor weights over all pairs.

    .. math:: w_i = \frac{2}{m (m-1)} \sum_{j \ne i} \frac{\sigma_j^2}{\sigma_i^2 + \sigma_j^2}

    A heuristic: not optimal even for independent errors, but less sensitive to one understated
    variance. Not for correlated errors.

    References: Comin and Saaj 2017, eq. 30, for three.
    """
    _check(std)
    m, variance = len(mean), std**2
    shares = variance / (variance[:, None] + variance)  # (i, j, ...); 1/2 with itself
    weights = (shares.sum(axis=1) - 0.5) * 2.0 / (m * (m - 1))
    fused = np.sqrt((weights**2 * variance).sum(axis=0))
    return FusedEstimate((weights * mean).sum(axis=0), fused, weights)


def best_linear(mean: Floats, std: Floats, correlation: Floats | None = None) -> FusedEstimate:
    r"""Best linear unbiased combination with non-negative weights.

    .. math:: \min_w w^T S w, \quad S = D R D, \quad \sum_i w_i = 1, \quad w_i \ge 0

    solved exactly by enumeration of the active sets: among the subsets of estimators whose
    unconstrained optimum has non-negative weights, that of least variance. Negative weights, which
    nearly collinear estimators would have, amplify differences that are mostly noise. The effort
    grows as 2^m: for up to six estimators.

    mean, std: Estimates and standard deviations (m, ...).
    correlation: Correlation R (m, m) of the errors; the identity by default.

    References: Bates and Granger, J. Oper. Res. Soc. 20(4), 1969.
    """
    _check(std)
    m = len(mean)
    R = np.eye(m) if correlation is None else correlation
    best_variance = np.full(std.shape[1:], np.inf)
    best_weights = np.zeros_like(std)
    subsets = (c for size in range(1, m + 1) for c in combinations(range(m), size))
    for subset in subsets:
        inverse = np.linalg.inv(R[np.ix_(subset, subset)] + RIDGE * np.eye(len(subset)))
        scaled = np.zeros_like(std)
        for i, row in zip(subset, inverse, strict=True):
            scaled[i] = sum(x / std[j] for x, j in zip(row, subset, strict=True)) / std[i]
        variance = 1.0 / scaled.sum(axis=0)
        better = (scaled[list(subset)] >= 0).all(axis=0) & (variance < best_variance)
        best_variance = np.where(better, variance, best_variance)
        best_weights = np.where(better, scaled * variance, best_weights)
    return FusedEstimate((best_weights * mean).sum(axis=0), np.sqrt(best_variance), best_weights)


def _check(std: Floats) -> None:
    """Raise `InputError` unless all standard deviations are positive."""
    if not bool(np.all(std > 0.0)):
        raise InputError(f"a standard deviation is {np.min(std):g}; it must be positive")


def shrink_correlation(correlation: Floats, share: float = 0.1) -> Floats:
    """A correlation matrix (m, m) shrunk by `share` towards its constant-correlation target.

    References: Ledoit and Wolf, J. Portfolio Management 30(4), 2004.
    """
    m = len(correlation)
    if m == 1:
        return correlation
    mean = (correlation.sum() - m) / (m * (m - 1))
    target = np.full((m, m), mean) + (1.0 - mean) * np.eye(m)
    return np.asarray((1.0 - share) * correlation + share * target)
