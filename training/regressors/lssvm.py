"""The least squares support vector machine with several outputs, solved exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from training.regressors.gaussian_head import GaussianHead, checked
from training.regressors.kernel_expansion import KernelExpansion
from training.regressors.rbf_kernel import log_squares, median_distance, rbf
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Looked at by leave-one-out where the user gives none: widths in median distances, and gammas.
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
GAMMAS = tuple(10.0 ** (0.5 * k) for k in range(-6, 17))


@dataclass(frozen=True)
class Factored:
    """Eigenvalues and vectors of a kernel matrix: every gamma's solution at matrix-product cost."""

    values: Floats  # (n,)
    vectors: Floats  # (n, n)

    @staticmethod
    def of(kernel: Floats) -> Factored:
        """One factorisation of a kernel matrix."""
        return Factored(*np.linalg.eigh(kernel))

    def solved(self, y: Floats, gamma: float) -> tuple[Floats, Floats, Floats]:
        r"""Dual weights (n, q), bias (q,) and leave-one-out residuals (n, q).

        .. math::
            \begin{bmatrix} 0 & 1^T \\ 1 & \Omega + I/\gamma \end{bmatrix}
            \begin{bmatrix} b^T \\ \alpha \end{bmatrix} =
            \begin{bmatrix} 0 \\ Y \end{bmatrix}, \qquad e_i = \alpha_i / (H^{-1})_{ii}

        References: Suykens and Vandewalle, Neural Processing Letters 9, 1999; closed-form
        leave-one-out, Cawley and Talbot, Neural Networks 17(10), 2004.
        """
        shrink = 1.0 / (np.maximum(self.values, 0.0) + 1.0 / gamma)
        ones = self.vectors.sum(axis=0)
        inverse_ones = self.vectors @ (shrink * ones)
        total = float(ones @ (shrink * ones))
        inverse_y = self.vectors @ (shrink[:, None] * (self.vectors.T @ y))
        bias = inverse_ones @ y / total
        alpha = inverse_y - inverse_ones[:, None] * bias
        diagonal = (self.vectors**2) @ shrink - inverse_ones**2 / total
        return alpha, bias, alpha / diagonal[:, None]

    def best_gamma(self, y: Floats, gammas: tuple[float, ...]) -> tuple[float, Floats]:
        """The gamma with the least leave-one-out error, and the mean square error of each."""
        errors = np.asarray([np.mean(self.solved(y, g)[2] ** 2) for g in gammas])
        return gammas[int(np.argmin(errors))], errors


class LSSVM(KernelExpansion):
    """Least squares support vector regression with bias, Gaussian kernel, any number of outputs.

    Parameters
    ----------
    gamma : float or None
        Weight of the errors against smoothness; chosen by closed-form leave-one-out if None.
    width : float or None
        Kernel width in standardised inputs; chosen likewise if None.

    `predict(X, return_std=True)` adds a standard deviation that varies with X: a second machine on
    the same kernel, fitted to the logarithms of the squared leave-one-out residuals. Cost grows
    with the cube of the rows: use `FixedSizeLSSVM` beyond some thousands.
    """

    kind: ClassVar[str] = "lssvm"

    def __init__(self, gamma: float | None = None, width: float | None = None) -> None:
        self.gamma = gamma
        self.width = width

    def fit(self, X: Any, y: Any) -> LSSVM:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        X, Y, one_output = checked(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        self.centres_ = self.x_scaling_.apply(X)
        Z = self.y_scaling_.apply(Y)
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        unit = median_distance(self.centres_)
        widths = [w * unit for w in WIDTHS] if self.width is None else [float(self.width)]
        least, self.search_ = np.inf, []
        with threadpool_limits(1):
            for width in widths:
                factored = Factored.of(rbf(self.centres_, self.centres_, width))
                gamma, errors = factored.best_gamma(Z, gammas)
                self.search_.append((width, np.asarray(gammas), errors))
                if errors.min() < least:
                    least, self.width_, self.gamma_, best = errors.min(), width, gamma, factored
            self.alpha_, self.bias_, self.loo_residual_ = best.solved(Z, self.gamma_)
            logs = log_squares(self.loo_residual_)
            spread_gamma, _ = best.best_gamma(logs, GAMMAS)
            self.spread_alpha_, self.spread_bias_, left = best.solved(logs, spread_gamma)
        self.head_ = GaussianHead.of(self.y_scaling_, logs - left, one_output)
        return self
