"""A regressor that reads all features of a spec, or only some: torque alone, vibration alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FeatureSubset:
    """A regressor, the columns of the features (n, d) that it reads, and what it is called.

    Estimates that read different sensors err more nearly independently than regressors of one
    reading do, and are worth joining. References: Comin and Saaj 2017, eqs. 18, 24 and 26.
    """

    kind: str
    machine: Any
    columns: tuple[int, ...] | None = None  # None: all of them

    def read(self, features: Floats) -> Floats:
        """The features (n, k) that the regressor is shown."""
        return features if self.columns is None else features[:, list(self.columns)]

    def predict(self, features: Floats, return_std: bool = False) -> Any:
        """Mean (n, q); with `return_std` a tuple with the standard deviation."""
        return self.machine.predict(self.read(features), return_std=return_std)

    def draw(self, graph: Graph, features: str) -> tuple[str, str]:
        """The regressor as nodes of an ONNX graph: names of mean and std, (n, q)."""
        if self.columns is not None:
            columns = graph.constant(np.asarray(self.columns, dtype=np.int64))
            features = graph.op("Gather", features, columns, axis=1)
        drawn: tuple[str, str] = self.machine.draw(graph, features)
        return drawn
