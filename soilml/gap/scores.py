"""Scores of columns against residuals, and their p values."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.subspaces import project_out


def scores(residual: Floats, columns: Floats, space: Floats) -> Floats:
    r"""Score (k,) of each whitened column (m, k) against whitened residuals (m,).

    .. math:: z_i = g_{\perp i} \cdot r / |g_{\perp i}|

    space (m, p): Directions that are projected out of the columns. A column in their span has the
        score zero.

    References: Rao, Proc. Cambridge Phil. Soc. 44, 1948.
    """
    projected = project_out(columns, space)
    norm, whole = np.linalg.norm(projected, axis=0), np.linalg.norm(columns, axis=0)
    testable = norm > 1e-4 * np.maximum(whole, 1e-300)
    return np.where(testable, projected.T @ residual / np.where(testable, norm, 1.0), 0.0)


def family_wise_p(z: float, count: int) -> float:
    """Probability that the largest of so many independent normal scores is as far from zero.

    References: Sidak, Journal of the American Statistical Association 62, 1967; correlated scores
    make it an upper bound.
    """
    from scipy.special import ndtr

    p = -np.expm1(count * np.log1p(-2.0 * ndtr(-abs(z))))
    return max(float(p), float(np.finfo(float).tiny))


def chi_square_tail(value: float, degrees_of_freedom: float) -> float:
    """Probability that a chi-square variable is above a value."""
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, value))
