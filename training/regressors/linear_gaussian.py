"""The straight line, as a baseline and as a member of fusions."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead, checked
from training.regressors.rbf_kernel import log_squares
from training.regressors.standardisation import Standardisation


class LinearGaussian(MultiOutputMixin, RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Linear mean and linear logarithm of the variance, by least squares with a little ridge.

    Parameters
    ----------
    ridge : float
        Penalty on the weights of standardised inputs, per row.
    """

    kind: ClassVar[str] = "linear"

    def __init__(self, ridge: float = 1e-8) -> None:
        self.ridge = ridge

    def fit(self, X: Any, y: Any) -> LinearGaussian:
        """Fit rows X (n, d) to y (n,) or (n, q)."""
        X, Y, one_output = checked(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        normal = x.T @ x + self.ridge * len(x) * np.eye(x.shape[1])
        self.weights_ = np.linalg.solve(normal, x.T @ z)
        self.bias_ = z.mean(axis=0)
        logs = log_squares(z - x @ self.weights_ - self.bias_)
        self.spread_weights_ = np.linalg.solve(normal, x.T @ (logs - logs.mean(axis=0)))
        self.spread_bias_ = logs.mean(axis=0)
        fitted = x @ self.spread_weights_ + self.spread_bias_
        self.head_ = GaussianHead.of(self.y_scaling_, fitted, one_output)
        return self

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Mean (n,) or (n, q); with `return_std` a tuple with the standard deviation."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        x = self.x_scaling_.apply(X)
        return self.head_.answer(
            x @ self.weights_ + self.bias_, x @ self.spread_weights_ + self.spread_bias_, return_std
        )

    def draw(self, graph: Graph, features: str) -> tuple[str, str]:
        """The fitted lines as nodes of an ONNX graph: names of mean and std, (n, q)."""
        x = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale)
        mean = graph.affine(x, self.weights_, self.bias_)
        logs = graph.affine(x, self.spread_weights_, self.spread_bias_)
        return self.head_.draw(graph, mean, logs)
