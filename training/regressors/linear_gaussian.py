"""Linear regression with a linear log-variance: a baseline, and a member of ensembles."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_regressor import (
    GaussianHead,
    GaussianRegressor,
    validate_training_data,
)
from training.regressors.rbf_expansion import log_squared_residuals
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]


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

    def fit(self, X: Any, y: Any) -> LinearGaussian:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        X, Y, one_output = validate_training_data(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        normal = x.T @ x + self.ridge * len(x) * np.eye(x.shape[1])
        self.weights_ = np.linalg.solve(normal, x.T @ z)
        self.bias_ = z.mean(axis=0)
        logs = log_squared_residuals(z - x @ self.weights_ - self.bias_)
        self.log_variance_weights_ = np.linalg.solve(normal, x.T @ (logs - logs.mean(axis=0)))
        self.log_variance_bias_ = logs.mean(axis=0)
        fitted = x @ self.log_variance_weights_ + self.log_variance_bias_
        self.head_ = GaussianHead.of(self.y_scaling_, fitted, one_output)
        return self

    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        return (
            x @ self.weights_ + self.bias_,
            x @ self.log_variance_weights_ + self.log_variance_bias_,
        )

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the regressor to an ONNX graph; names of mean and std, (n, q)."""
        x = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale)
        mean = graph.affine(x, self.weights_, self.bias_)
        logs = graph.affine(x, self.log_variance_weights_, self.log_variance_bias_)
        return self.head_.add_to_graph(graph, mean, logs)
