"""Outliers: readings that all others together do not expect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.gap.statistics.reml_covariance import Covariance
from soilml.quantities import Z_50

Floats = NDArray[np.float64]

#: A reading whose residual exceeds this many standard deviations is an outlier; where more than
#: this share of the readings do, they are not outliers but a pattern.
THRESHOLD, MOST_OUTLIERS = 4.5, 0.1


def outliers(covariance: Covariance, residual: Floats, space: Floats) -> NDArray[np.bool_]:
    r"""Readings (m,) that all others together do not expect.

    .. math:: t_i = (P r)_i / \sqrt{P_{ii}}, \quad
        P = V^{-1} - V^{-1} X (X^T V^{-1} X)^{-1} X^T V^{-1}

    against the median size of t. References: Cook and Weisberg, Residuals and Influence, 1982.
    """
    white = covariance.whiten @ space
    u, s, _ = np.linalg.svd(white, full_matrices=False)
    basis = u[:, s > max(1e-3 * float(s[0]), 0.3)]
    inside = np.eye(len(residual)) - basis @ basis.T
    p = covariance.whiten.T @ inside @ covariance.whiten
    diagonal = np.diag(p)
    sure = diagonal > 1e-3 / covariance.std**2
    t = np.where(sure, (p @ residual) / np.sqrt(np.where(sure, diagonal, 1.0)), 0.0)
    typical = max(1.0, float(np.median(np.abs(t[sure]))) / Z_50) if sure.any() else 1.0
    return np.asarray(np.abs(t) > THRESHOLD * typical)
