"""A regressor that reads all features of a spec or some of them: torque alone, vibration alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_regressor import GaussianRegressor, Progress

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FeatureSubset:
    """A regressor and the columns of the features (n, d) that it reads.

    Errors of estimates from different sensors are less correlated than those of different
    regressors of the same reading: fusing them reduces the error more.

    Attributes
    ----------
    name : str
        Label in metrics, card and plots.
    model : GaussianRegressor
        The regressor itself.
    columns : tuple of int or None
        Columns that it reads; None for all.

    References
    ----------
    Comin and Saaj 2017, eqs. 18, 24 and 26.
    """

    name: str
    model: GaussianRegressor
    columns: tuple[int, ...] | None = None

    def select(self, features: Floats) -> Floats:
        """The columns (n, k) that the regressor reads."""
        return features if self.columns is None else features[:, list(self.columns)]

    def fit(
        self,
        training: tuple[Floats, Floats],
        validation: tuple[Floats, Floats],
        progress: Progress,
    ) -> None:
        """Fit the regressor to features and targets, with others for early stopping."""
        subset = (self.select(validation[0]), validation[1])
        self.model.fit_with_validation(self.select(training[0]), training[1], subset, progress)

    def predict(self, features: Floats, return_std: bool = False) -> Any:
        """Mean (n, q); with `return_std` a tuple with the standard deviation."""
        return self.model.predict(self.select(features), return_std=return_std)

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the regressor to an ONNX graph; names of mean and std, (n, q)."""
        if self.columns is not None:
            columns = graph.constant(np.asarray(self.columns, dtype=np.int64))
            features = graph.op("Gather", features, columns, axis=1)
        return self.model.add_to_graph(graph, features)
