"""Least squares of relative residuals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Rounds in which the weights follow the fit; they settle in two or three.
ROUNDS = 4
#: Least fitted value, as a fraction of the measured one, that is used for a weight.
LEAST_FITTED = 1e-3


def relative_line(columns: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients (p,) of columns (N, p), their derivatives (p, N), and the fitted values (N,).

    The residuals are those of y (N,), which is positive, relative to the fit; the derivatives are
    those by the relative errors of y.
    """
    fitted = y.copy()
    for _ in range(ROUNDS):
        scaled = columns / fitted[:, None]
        hat = np.asarray(np.linalg.pinv(scaled))
        line = np.asarray(hat @ (y / fitted))
        fitted = np.maximum(columns @ line, LEAST_FITTED * y)
    return line, hat, fitted
