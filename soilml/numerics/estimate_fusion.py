"""Joining several estimates of one quantity into one.

Which rule is right depends on where the errors come from. Estimates from different sensors or
different times err independently: weigh them by inverse variance. Regressors that read the same
measurement err together (their residuals correlate by 0.8 and more): weighing them so claims far
too much, and a rule that knows their correlation, or assumes the worst of it, is needed.

All rules take `mean` and `std` of shape (m, ...), m estimators first, and return `FusedEstimate`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError

Floats = NDArray[np.float64]


#: Keeps the correlation matrix of two estimators that are one and the same invertible.
TWIN = 1e-9


@dataclass(frozen=True)
class FusedEstimate:
    """Fused mean and standard deviation (...), and the weights (m, ...) that sum to one."""

    mean: Floats
    std: Floats
    weights: Floats


def inverse_variance(mean: Floats, std: Floats, correlation: Floats | None = None) -> FusedEstimate:
    r"""Weights 1 / sigma^2: right, and optimal, for independent errors alone.

    .. math:: w_i = \sigma_i^{-2} / \sum_j \sigma_j^{-2}, \quad \sigma^2 = 1 / \sum_j \sigma_j^{-2}

    References: Comin and Saaj 2017, eq. 26, for two.
    """
    _check(std)
    information = std**-2.0
    weights = information / information.sum(axis=0)
    return FusedEstimate((weights * mean).sum(axis=0), information.sum(axis=0) ** -0.5, weights)


def pairwise(mean: Floats, std: Floats, correlation: Floats | None = None) -> FusedEstimate:
    r"""Mean of the two-sensor weights over all partners.

    .. math:: w_i = \frac{2}{m (m-1)} \sum_{j \ne i} \frac{\sigma_j^2}{\sigma_i^2 + \sigma_j^2}

    References: Comin and Saaj 2017, eq. 30, for three. Heuristic: not optimal even for independent
    errors, but less hostage to one understated variance.
    """
    _check(std)
    m = len(mean)
    variance = std**2
    weights = np.zeros_like(std)
    for i in range(m):
        for j in range(m):
            if j != i:
                weights[i] += variance[j] / (variance[i] + variance[j])
    weights *= 2.0 / (m * (m - 1))
    return FusedEstimate(
        (weights * mean).sum(axis=0), np.sqrt((weights**2 * variance).sum(axis=0)), weights
    )


def best_linear(mean: Floats, std: Floats, correlation: Floats | None = None) -> FusedEstimate:
    r"""Non-negative best linear unbiased combination under the errors' correlation (m, m).

    .. math:: \min_w w^T S w, \quad S = D R D, \quad \sum_i w_i = 1, \quad w_i \ge 0

    exactly, by looking at every subset of estimators: the unconstrained optimum over one of them,
    where its weights are positive, is the optimum. Negative weights, which collinear estimators
    ask for, trade on differences that are mostly noise. References: Bates and Granger, J. Oper.
    Res. Soc. 20(4), 1969. For up to five or six estimators.
    """
    _check(std)
    m = len(mean)
    R = np.eye(m) if correlation is None else correlation
    best_variance = np.full(std.shape[1:], np.inf)
    best_weights = np.zeros_like(std)
    for subset in _subsets(m):
        inverse = np.linalg.inv(R[np.ix_(subset, subset)] + TWIN * np.eye(len(subset)))
        scaled = np.zeros_like(std)
        for i, row in zip(subset, inverse, strict=True):
            scaled[i] = sum(x / std[j] for x, j in zip(row, subset, strict=True)) / std[i]
        variance = 1.0 / scaled.sum(axis=0)
        better = (scaled[list(subset)] >= 0).all(axis=0) & (variance < best_variance)
        best_variance = np.where(better, variance, best_variance)
        best_weights = np.where(better, scaled * variance, best_weights)
    return FusedEstimate((best_weights * mean).sum(axis=0), np.sqrt(best_variance), best_weights)


def _subsets(m: int) -> list[tuple[int, ...]]:
    """Every non-empty subset of m estimators."""
    return [chosen for size in range(1, m + 1) for chosen in combinations(range(m), size)]


def covariance_intersection(
    mean: Floats, std: Floats, correlation: Floats | None = None
) -> FusedEstimate:
    r"""Equal shares of information: consistent whatever the correlation, never overconfident.

    .. math:: \sigma^{-2} = \frac{1}{m} \sum_i \sigma_i^{-2}, \quad
        w_i = \sigma_i^{-2} / \sum_j \sigma_j^{-2}

    References: Julier and Uhlmann, Proc. American Control Conference, 1997, with omega = 1/m.
    """
    _check(std)
    information = std**-2.0
    weights = information / information.sum(axis=0)
    return FusedEstimate((weights * mean).sum(axis=0), information.mean(axis=0) ** -0.5, weights)


def _check(std: Floats) -> None:
    """Raise `InputError` for an estimate that claims to be certain: no other has a weight then."""
    if not bool(np.all(std > 0.0)):
        raise InputError(f"a standard deviation is {np.min(std):g}; needed is a number above 0")


def shrunk(correlation: Floats, share: float = 0.1) -> Floats:
    """A correlation matrix drawn towards one in which all pairs correlate alike.

    References: Ledoit and Wolf, J. Portfolio Management 30(4), 2004 (constant correlation).
    """
    m = len(correlation)
    if m == 1:
        return correlation
    mean = (correlation.sum() - m) / (m * (m - 1))
    target = np.full((m, m), mean) + (1.0 - mean) * np.eye(m)
    return np.asarray((1.0 - share) * correlation + share * target)


#: The rule for regressors of the same measurement: it knows how their errors correlate.
BEST_LINEAR = "best-linear"
#: The rule that holds whatever the correlation of the errors.
COVARIANCE_INTERSECTION = "covariance-intersection"

#: Rule by the name that a training spec takes.
RULES: dict[str, Callable[..., FusedEstimate]] = {
    BEST_LINEAR: best_linear,
    COVARIANCE_INTERSECTION: covariance_intersection,
    "inverse-variance": inverse_variance,
    "pairwise": pairwise,
}
