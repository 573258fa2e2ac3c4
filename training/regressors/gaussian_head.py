"""What all regressors end in: a mean and a log-variance, in standardised outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import validate_data

from training.onnx_graph.builder import Graph
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Share of the training rows whose log-variances are cut at either end.
TAIL = 0.001


def checked(estimator: Any, X: Any, y: Any) -> tuple[Floats, Floats, bool]:
    """X (n, d), y as (n, q), and whether y came as (n,); faults raise as in scikit-learn."""
    rules = {"multi_output": True, "y_numeric": True, "dtype": np.float64, "ensure_min_samples": 2}
    X, y = validate_data(estimator, X, y, **rules)
    return X, y.reshape(len(y), -1).astype(np.float64), y.ndim == 1


@dataclass(frozen=True)
class GaussianHead:
    """Back to the outputs' units, with the log-variance kept to what it was on training rows.

    Beyond those it would extrapolate to certainty, or to none.
    """

    scaling: Standardisation
    low: Floats  # (q,)
    high: Floats
    one_output: bool

    @staticmethod
    def of(scaling: Standardisation, logs: Floats, one_output: bool) -> GaussianHead:
        """From the log-variances (n, q) that the regressor gives its training rows."""
        low, high = np.quantile(logs, [TAIL, 1.0 - TAIL], axis=0)
        return GaussianHead(scaling, low, high, one_output)

    def answer(self, mean: Floats, logs: Floats, return_std: bool) -> Any:
        """Mean, or mean and standard deviation, (n,) or (n, q) as y was."""
        mean = self.scaling.undo(mean)
        std = np.exp(0.5 * np.clip(logs, self.low, self.high)) * self.scaling.scale
        if self.one_output:
            mean, std = mean[:, 0], std[:, 0]
        return (mean, std) if return_std else mean

    def draw(self, graph: Graph, mean: str, logs: str) -> tuple[str, str]:
        """The same as nodes of an ONNX graph: names of mean and std, (n, q)."""
        grown = graph.op("Mul", mean, graph.constant(self.scaling.scale))
        kept = graph.op(
            "Min", graph.op("Max", logs, graph.constant(self.low)), graph.constant(self.high)
        )
        std = graph.op("Exp", graph.op("Mul", kept, graph.constant(np.float64(0.5))))
        return (
            graph.op("Add", grown, graph.constant(self.scaling.mean)),
            graph.op("Mul", std, graph.constant(self.scaling.scale)),
        )
