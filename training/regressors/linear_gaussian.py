"""Linear regression with a linear log-variance: a baseline, and a member of ensembles."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import Tensor, affine
from training.regressors.gaussian_regressor import (
    GaussianRegressor,
    Groups,
    Progress,
    log_squared_residuals,
)


class LinearGaussian(GaussianRegressor):
    """Mean and log-variance linear in X, by ridge regression.

    Parameters
    ----------
    ridge : float
        Penalty on the weights of standardised inputs, per row.

    Notes
    -----
    The log-variance is fitted to the logarithms of the squared residuals of the mean.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(0.0, 1.0, 50)[:, None]
    >>> print(np.round(LinearGaussian().fit(x, 3.0 * x[:, 0] + 1.0).predict([[2.0]]), 3))
    [7.]
    """

    type_name: ClassVar[str] = "linear"

    def __init__(self, ridge: float = 1e-8) -> None:
        self.ridge = ridge

    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        self.weights_, self.bias_ = self._ridge(x, z)
        self.fit_log_variance(x, z - x @ self.weights_ - self.bias_)

    def fit_log_variance(self, x: Floats, residual: Floats) -> Self:
        """Fit the log-variance alone, to residuals (n, q) of another mean."""
        found = self._ridge(x, log_squared_residuals(residual))
        self.log_variance_weights_, self.log_variance_bias_ = found
        return self

    def log_variance(self, x: Tensor) -> Tensor:
        """Log-variance (n, q) of standardised rows."""
        return affine(x, self.log_variance_weights_, self.log_variance_bias_)

    def _ridge(self, x: Floats, z: Floats) -> tuple[Floats, Floats]:
        """Weights (d, q) and bias (q,) of a ridge regression."""
        centre, bias = x.mean(axis=0), z.mean(axis=0)
        normal = x.T @ x + self.ridge * len(x) * np.eye(x.shape[1])
        normal -= len(x) * np.outer(centre, centre)
        weights = np.linalg.solve(normal, (x - centre).T @ z)
        return weights, bias - centre @ weights

    def _standardised_outputs(self, x: Tensor) -> tuple[Tensor, Tensor]:
        return affine(x, self.weights_, self.bias_), self.log_variance(x)
