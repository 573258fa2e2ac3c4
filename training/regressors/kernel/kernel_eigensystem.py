"""Eigendecomposition of a kernel matrix, from which the solution for any gamma is cheap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class KernelEigensystem:
    """Eigendecomposition of a kernel matrix; the solution for any gamma then costs O(n^2)."""

    values: Floats  # (n,)
    vectors: Floats  # (n, n)

    @staticmethod
    def of(kernel: Floats) -> KernelEigensystem:
        """Decompose a kernel matrix (n, n)."""
        return KernelEigensystem(*np.linalg.eigh(kernel))

    def solve(self, y: Floats, gamma: float) -> tuple[Floats, Floats, Floats]:
        r"""Dual weights (n, q), bias (q,) and leave-one-out residuals (n, q).

        .. math::
            \begin{bmatrix} 0 & 1^T \\ 1 & \Omega + I/\gamma \end{bmatrix}
            \begin{bmatrix} b^T \\ \alpha \end{bmatrix} =
            \begin{bmatrix} 0 \\ Y \end{bmatrix}, \qquad e_i = \alpha_i / (H^{-1})_{ii}

        References
        ----------
        Suykens and Vandewalle, Neural Processing Letters 9, 1999; closed-form leave-one-out: Cawley
        and Talbot, Neural Networks 17(10), 2004.
        """
        weights = 1.0 / (np.maximum(self.values, 0.0) + 1.0 / gamma)
        ones = self.vectors.sum(axis=0)
        inverse_ones = self.vectors @ (weights * ones)
        total = float(ones @ (weights * ones))
        inverse_y = self.vectors @ (weights[:, None] * (self.vectors.T @ y))
        bias = inverse_ones @ y / total
        alpha = inverse_y - inverse_ones[:, None] * bias
        diagonal = (self.vectors**2) @ weights - inverse_ones**2 / total
        return alpha, bias, alpha / diagonal[:, None]

    def leave_one_out_errors(self, y: Floats, gammas: tuple[float, ...]) -> Floats:
        """Mean squared leave-one-out error of each gamma."""
        return np.asarray([np.mean(self.solve(y, g)[2] ** 2) for g in gammas])

    def validation_errors(
        self, y: Floats, kernel: Floats, truth: Floats, gammas: tuple[float, ...]
    ) -> Floats:
        """Mean squared error of each gamma at rows (k, q) with a kernel (k, n) to the rows here."""
        errors = []
        for gamma in gammas:
            alpha, bias, _ = self.solve(y, gamma)
            errors.append(np.mean((kernel @ alpha + bias - truth) ** 2))
        return np.asarray(errors)
