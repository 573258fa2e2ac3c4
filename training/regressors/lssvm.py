"""Least squares support vector regression with several outputs, solved exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from training.regressors.gaussian_head import GaussianHead, validate_training_data
from training.regressors.kernel_expansion import KernelExpansion
from training.regressors.rbf_kernel import log_squared_residuals, median_distance, rbf
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Searched by leave-one-out unless fixed: widths in median distances between rows, and gammas.
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
GAMMAS = tuple(10.0 ** (0.5 * k) for k in range(-6, 17))


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

    def best_gamma(self, y: Floats, gammas: tuple[float, ...]) -> tuple[float, Floats]:
        """The gamma with the least leave-one-out error, and the mean squared error of each."""
        errors = np.asarray([np.mean(self.solve(y, g)[2] ** 2) for g in gammas])
        return gammas[int(np.argmin(errors))], errors


class LSSVM(KernelExpansion):
    """Least squares support vector regression with bias, Gaussian kernel, any number of outputs.

    Parameters
    ----------
    gamma : float or None
        Weight of the errors against smoothness; selected by closed-form leave-one-out if None.
    width : float or None
        Kernel width in standardised inputs; selected in the same way if None.

    Notes
    -----
    The log-variance is a second expansion on the same kernel, fitted to the logarithms of the
    squared leave-one-out residuals. The cost grows with the cube of the number of rows: use
    `FixedSizeLSSVM` beyond some thousands.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(0.0, 6.0, 40)[:, None]
    >>> mean = LSSVM().fit(x, np.sin(x[:, 0])).predict([[1.5]])
    >>> print(np.round(mean, 2))
    [1.]
    """

    type_name: ClassVar[str] = "lssvm"

    def __init__(self, gamma: float | None = None, width: float | None = None) -> None:
        self.gamma = gamma
        self.width = width

    def fit(self, X: Any, y: Any) -> LSSVM:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        X, Y, one_output = validate_training_data(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        self.centres_ = self.x_scaling_.apply(X)
        Z = self.y_scaling_.apply(Y)
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        median = median_distance(self.centres_)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        least, self.search_ = np.inf, []
        with threadpool_limits(1):
            for width in widths:
                eigensystem = KernelEigensystem.of(rbf(self.centres_, self.centres_, width))
                gamma, errors = eigensystem.best_gamma(Z, gammas)
                self.search_.append((width, np.asarray(gammas), errors))
                if errors.min() < least:
                    least, self.width_, self.gamma_, best = errors.min(), width, gamma, eigensystem
            self.alpha_, self.bias_, self.loo_residual_ = best.solve(Z, self.gamma_)
            logs = log_squared_residuals(self.loo_residual_)
            gamma, _ = best.best_gamma(logs, GAMMAS)
            self.log_variance_alpha_, self.log_variance_bias_, residual = best.solve(logs, gamma)
        self.head_ = GaussianHead.of(self.y_scaling_, logs - residual, one_output)
        return self

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """None: fitting again takes too long."""
        return None
