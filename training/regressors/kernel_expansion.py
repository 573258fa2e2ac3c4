"""Regressors that are expansions on a kernel: their prediction, and their ONNX graph."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol, final

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.builder import Graph
from training.regressors.gaussian_regressor import GaussianRegressor, Progress, Requirements
from training.regressors.rbf_expansion import Expansion, Rows, rbf

#: Elements of the kernel matrix that a prediction computes at a time.
PREDICTED_AT_A_TIME = 4_000_000


class KernelSolution(Protocol):
    """How the weights of an expansion are found; see `ExactSolution`."""

    @property
    def name(self) -> str:
        """As in the spec."""
        ...

    def solve(self, x: Floats, z: Floats, validation: Rows | None, progress: Progress) -> Expansion:
        """The expansion for standardised inputs (n, d) and outputs (n, q)."""
        ...

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        ...

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows."""
        ...


class KernelExpansion(GaussianRegressor):
    r"""Prediction and export of regressors of the form :math:`\sum_j \alpha_j k(x, c_j) + b`."""

    # Centres, width and weights in standardised units, and how they were selected
    expansion_: Expansion

    @abstractmethod
    def solution_for(self, rows: int) -> KernelSolution:
        """The solution that is used for a number of training rows."""

    @final
    def _fit_standardised(
        self, x: Floats, z: Floats, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> Floats:
        self.expansion_ = self.solution_for(len(x)).solve(x, z, validation, progress)
        return self.expansion_.log_variances

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
    def _input_factor(self) -> float:
        """With x and centres divided by sqrt(2) width the kernel is exp(-|x - c|^2)."""
        return float(1.0 / (np.sqrt(2.0) * self.expansion_.width))

    @final
    def _add_standardised_outputs(self, graph: Graph, x: str) -> tuple[str, str]:
        found = self.expansion_
        squared = graph.squared_distances(x, found.centres * self._input_factor())
        kernel = graph.op("Exp", graph.op("Neg", squared))
        q = found.alpha.shape[1]
        weights = np.hstack([found.alpha, found.log_variance_alpha])
        bias = np.concatenate([found.bias, found.log_variance_bias])
        both = graph.affine(kernel, weights, bias)
        return graph.columns(both, 0, q), graph.columns(both, q, 2 * q)

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
