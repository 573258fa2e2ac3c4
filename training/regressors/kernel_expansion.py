"""Base of the kernel regressors: two expansions, mean and log-variance, on one kernel row."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Self, final

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead, validate_training_data
from training.regressors.gaussian_regressor import GaussianRegressor, Progress, Requirements
from training.regressors.kernel.exact_solution import ExactSolution
from training.regressors.kernel.expansion import Expansion
from training.regressors.kernel.fixed_size_solution import FixedSizeSolution
from training.regressors.kernel.rbf_kernel import rbf
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Elements of the kernel matrix that a prediction computes at a time.
PREDICTED_AT_A_TIME = 4_000_000


class KernelExpansion(GaussianRegressor):
    r"""Prediction and export of regressors of the form :math:`\sum_j \alpha_j k(x, c_j) + b`.

    Attributes
    ----------
    expansion_ : Expansion
        Centres, width and weights in standardised units, and how they were selected.
    """

    expansion_: Expansion

    @abstractmethod
    def solution_for(self, rows: int) -> ExactSolution | FixedSizeSolution:
        """The solution that is used for a number of training rows."""

    @final
    def fit(self, X: Any, y: Any) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q); hyperparameters are selected by leave-one-out."""
        return self._fit(X, y, None, lambda done, total: None)

    @final
    def fit_with_validation(
        self, X: Floats, y: Floats, validation: tuple[Floats, Floats], progress: Progress
    ) -> Self:
        """Fit rows X (n, d) to y (n,) or (n, q); validation rows select the hyperparameters."""
        return self._fit(X, y, validation, progress)

    def _fit(
        self, X: Any, y: Any, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> Self:
        X, Y, one_output = validate_training_data(self, X, y)
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        x, z = self.x_scaling_.apply(X), self.y_scaling_.apply(Y)
        if validation is not None:
            truth = validation[1].reshape(len(validation[1]), -1)
            validation = (self.x_scaling_.apply(validation[0]), self.y_scaling_.apply(truth))
        self.expansion_ = self.solution_for(len(x)).solve(x, z, validation, progress)
        self.head_ = GaussianHead.of(self.y_scaling_, self.expansion_.log_variances, one_output)
        return self

    @final
    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        found = self.expansion_
        weights = np.hstack([found.alpha, found.log_variance_alpha])
        chunk = max(PREDICTED_AT_A_TIME // len(found.centres), 1)
        parts = [
            rbf(x[i : i + chunk], found.centres, found.width) @ weights
            for i in range(0, len(x), chunk)
        ]
        mean, log_variance = np.split(np.vstack(parts), 2, axis=1)
        return mean + found.bias, log_variance + found.log_variance_bias

    @final
    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the regressor to an ONNX graph in float64; names of mean and std, (n, q)."""
        found = self.expansion_
        # with x and centres divided by sqrt(2) width the kernel is exp(-|x - c|^2)
        factor = 1.0 / (np.sqrt(2.0) * found.width)
        x = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale / factor)
        squared = graph.squared_distances(x, found.centres * factor)
        kernel = graph.op("Exp", graph.op("Neg", squared))
        q = found.alpha.shape[1]
        weights = np.hstack([found.alpha, found.log_variance_alpha])
        bias = np.concatenate([found.bias, found.log_variance_bias])
        both = graph.affine(kernel, weights, bias)
        mean, log_variance = graph.columns(both, 0, q), graph.columns(both, q, 2 * q)
        return self.head_.add_to_graph(graph, mean, log_variance)

    @final
    def requirements(self, rows: int, inputs: int, outputs: int) -> Requirements:
        """Number of prototypes, and the memory of the solution."""
        solution = self.solution_for(rows)
        size = f"{solution.name}, {solution.prototypes(rows)} prototypes"
        return Requirements(size, solution.bytes(rows, inputs, outputs))

    @final
    def fitted_settings(self) -> str:
        """Solution, number of centres, gamma and width."""
        e = self.expansion_
        return f"{e.solution}, {len(e.centres)} centres, gamma {e.gamma:.3g}, width {e.width:.3g}"

    @final
    def hyperparameter_search(self) -> list[tuple[float, Floats, Floats]]:
        """Kernel width, gammas and held-out errors of each width; the selected one is the last."""
        return self.expansion_.search

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """The chosen gamma and width; None where fitting again takes too long."""
        if self.expansion_.solution == "exact":
            return None
        return {"gamma": self.expansion_.gamma, "width": self.expansion_.width}
