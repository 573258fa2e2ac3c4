"""What a fitted kernel machine is: centres, weights, and two expansions on one kernel row."""

from __future__ import annotations

from abc import ABC
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead
from training.regressors.rbf_kernel import rbf
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]


class KernelExpansion(MultiOutputMixin, RegressorMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """Prediction and export of machines whose `fit` sets the attributes below."""

    x_scaling_: Standardisation
    centres_: Floats  # (m, d) standardised
    width_: float
    alpha_: Floats  # (m, q) of the mean
    bias_: Floats  # (q,)
    spread_alpha_: Floats  # (m, q) of the log-variance
    spread_bias_: Floats  # (q,)
    head_: GaussianHead

    @final
    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Mean (n,) or (n, q); with `return_std` a tuple with the standard deviation."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        row = rbf(self.x_scaling_.apply(X), self.centres_, self.width_)
        return self.head_.answer(
            row @ self.alpha_ + self.bias_, row @ self.spread_alpha_ + self.spread_bias_, return_std
        )

    @final
    def draw(self, graph: Graph, features: str) -> tuple[str, str]:
        """The machine as nodes of an ONNX graph, float64: names of mean and std, (n, q)."""
        shrink = 1.0 / (np.sqrt(2.0) * self.width_)
        x = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale / shrink)
        row = graph.op("Exp", graph.op("Neg", graph.squared_distances(x, self.centres_ * shrink)))
        q = self.alpha_.shape[1]
        weights = np.hstack([self.alpha_, self.spread_alpha_])
        both = graph.affine(row, weights, np.concatenate([self.bias_, self.spread_bias_]))
        return self.head_.draw(graph, graph.columns(both, 0, q), graph.columns(both, q, 2 * q))
