"""Outliers: readings inconsistent with all other readings together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.gap.statistics.reml_covariance import FIXED_EFFECT_TOLERANCES, Covariance
from soilml.numerics.subspaces import column_space
from soilml.quantities import Z_50

Floats = NDArray[np.float64]

#: Studentised residual above which a reading is an outlier: chance exceeds it once in 150 000
#: readings.
OUTLIER_SIGMA = 4.5
#: Fraction of outliers above which they form a pattern, so that the data cannot be analysed.
MAX_OUTLIER_FRACTION = 0.1
#: Readings whose residual variance is below this fraction of their own are determined by the fit;
#: their studentised residual is undefined.
MIN_RESIDUAL_VARIANCE = 1e-3


def outliers(covariance: Covariance, residual: Floats, space: Floats) -> NDArray[np.bool_]:
    r"""Readings (m,) whose studentised residual is large.

    .. math:: t_i = (P r)_i / \sqrt{P_{ii}}, \quad
        P = V^{-1} - V^{-1} X (X^T V^{-1} X)^{-1} X^T V^{-1}

    compared with a robust scale, the median of \|t\|, where that exceeds 1.

    Parameters
    ----------
    residual : array (m,)
    space : array (m, q)
        X, all that soil, effects and smooth functions could explain.

    References
    ----------
    Cook and Weisberg, Residuals and Influence in Regression, 1982.
    """
    whiten = covariance.whiten
    basis = column_space(whiten @ space, **FIXED_EFFECT_TOLERANCES)
    complement = np.eye(len(residual)) - basis @ basis.T
    p = whiten.T @ complement @ whiten
    diagonal = np.diag(p)
    defined = diagonal > MIN_RESIDUAL_VARIANCE / covariance.std**2
    t = np.where(defined, (p @ residual) / np.sqrt(np.where(defined, diagonal, 1.0)), 0.0)
    scale = 1.0
    if defined.any():
        scale = max(1.0, float(np.median(np.abs(t[defined]))) / Z_50)
    return np.asarray(np.abs(t) > OUTLIER_SIGMA * scale)
