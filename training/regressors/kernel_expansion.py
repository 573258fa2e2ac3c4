"""Base of the kernel regressors: two expansions, mean and log-variance, on one kernel row."""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_regressor import GaussianRegressor
from training.regressors.rbf_kernel import rbf

Floats = NDArray[np.float64]


class KernelExpansion(GaussianRegressor):
    r"""Prediction and export of regressors of the form :math:`\sum_j \alpha_j k(x, c_j) + b`.

    Attributes
    ----------
    centres_ : ndarray, shape (m, d)
        Standardised.
    width_, gamma_ : float
        Width of the Gaussian kernel, and weight of the errors against smoothness.
    alpha_, bias_ : ndarray, shapes (m, q) and (q,)
        Of the mean.
    log_variance_alpha_, log_variance_bias_ : ndarray, shapes (m, q) and (q,)
        Of the log-variance.
    search_ : list
        See `hyperparameter_search`.
    """

    centres_: Floats
    width_: float
    gamma_: float
    alpha_: Floats
    bias_: Floats
    log_variance_alpha_: Floats
    log_variance_bias_: Floats
    search_: list[tuple[float, Floats, Floats]]

    @final
    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        kernel = rbf(x, self.centres_, self.width_)
        return (
            kernel @ self.alpha_ + self.bias_,
            kernel @ self.log_variance_alpha_ + self.log_variance_bias_,
        )

    @final
    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the regressor to an ONNX graph in float64; names of mean and std, (n, q)."""
        # with x and centres divided by sqrt(2) width the kernel is exp(-|x - c|^2)
        factor = 1.0 / (np.sqrt(2.0) * self.width_)
        x = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale / factor)
        squared = graph.squared_distances(x, self.centres_ * factor)
        kernel = graph.op("Exp", graph.op("Neg", squared))
        q = self.alpha_.shape[1]
        weights = np.hstack([self.alpha_, self.log_variance_alpha_])
        bias = np.concatenate([self.bias_, self.log_variance_bias_])
        both = graph.affine(kernel, weights, bias)
        mean, log_variance = graph.columns(both, 0, q), graph.columns(both, q, 2 * q)
        return self.head_.add_to_graph(graph, mean, log_variance)

    @final
    def fitted_settings(self) -> str:
        """Number of centres, gamma and width."""
        return f"{len(self.centres_)} centres, gamma {self.gamma_:.3g}, width {self.width_:.3g}"

    @final
    def hyperparameter_search(self) -> list[tuple[float, Floats, Floats]]:
        """Kernel width, gammas and leave-one-out errors of each width that was searched."""
        return self.search_

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """The chosen gamma and width."""
        return {"gamma": self.gamma_, "width": self.width_}
