"""The common last step of all regressors: mean and log-variance of standardised outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import validate_data

from training.onnx_graph.builder import Graph
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Share of the training rows whose log-variances are clipped at either end.
TAIL = 0.001


def validate_training_data(regressor: Any, X: Any, y: Any) -> tuple[Floats, Floats, bool]:
    """X (n, d), y as (n, q), and whether y was (n,); raises `ValueError` as scikit-learn does."""
    rules = {"multi_output": True, "y_numeric": True, "dtype": np.float64, "ensure_min_samples": 2}
    X, y = validate_data(regressor, X, y, **rules)
    return X, y.reshape(len(y), -1).astype(np.float64), y.ndim == 1


@dataclass(frozen=True)
class GaussianHead:
    """Converts standardised outputs to mean and standard deviation in the units of y.

    The log-variance is clipped to its range on the training rows: outside their domain a regressor
    would extrapolate it without bound.
    """

    scaling: Standardisation
    low: Floats  # (q,) bounds of the log-variance
    high: Floats
    one_output: bool  # y was (n,)

    @staticmethod
    def of(scaling: Standardisation, log_variance: Floats, one_output: bool) -> GaussianHead:
        """From the log-variances (n, q) of the training rows."""
        low, high = np.quantile(log_variance, [TAIL, 1.0 - TAIL], axis=0)
        return GaussianHead(scaling, low, high, one_output)

    def to_original_units(self, mean: Floats, log_variance: Floats, return_std: bool) -> Any:
        """Mean, or mean and standard deviation, (n,) or (n, q) as y was."""
        mean = self.scaling.undo(mean)
        std = np.exp(0.5 * np.clip(log_variance, self.low, self.high)) * self.scaling.scale
        if self.one_output:
            mean, std = mean[:, 0], std[:, 0]
        return (mean, std) if return_std else mean

    def add_to_graph(self, graph: Graph, mean: str, log_variance: str) -> tuple[str, str]:
        """Add the same conversion to an ONNX graph; names of mean and std, (n, q)."""
        scaled = graph.op("Mul", mean, graph.constant(self.scaling.scale))
        raised = graph.op("Max", log_variance, graph.constant(self.low))
        clipped = graph.op("Min", raised, graph.constant(self.high))
        std = graph.op("Exp", graph.op("Mul", clipped, graph.constant(np.float64(0.5))))
        return (
            graph.op("Add", scaled, graph.constant(self.scaling.mean)),
            graph.op("Mul", std, graph.constant(self.scaling.scale)),
        )
