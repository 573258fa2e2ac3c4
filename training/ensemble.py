"""Several regressors of the same row, fused into one estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.estimate_fusion import BEST_LINEAR, RULES, best_linear, shrink_correlation
from training.calibration.recalibration import CalibratedRegressor
from training.data.dataset import Dataset
from training.onnx_graph.builder import Graph
from training.onnx_graph.fusion_rules import add_best_linear_fusion, add_rowwise_fusion

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Ensemble:
    """Calibrated members, the rule that fuses them, and the correlation of their errors.

    The rule `best-linear` uses one set of weights for all rows, from the covariance of the errors:
    weights of each row would favour the member that happens to be overconfident there.
    """

    members: tuple[CalibratedRegressor, ...]
    rule: str
    correlation: Floats  # (q, m, m) between the members' errors
    weights: Floats  # (m, q) of the rule best-linear

    def predict(self, features: Floats, return_std: bool = True) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n, q) by the rule, before recalibration."""
        predictions = [member.predict(features) for member in self.members]
        mean, std = np.stack([m for m, _ in predictions]), np.stack([s for _, s in predictions])
        if self.rule == BEST_LINEAR:
            weighted = self.weights[:, None, :] * std
            variance = np.einsum("inq,qij,jnq->nq", weighted, self.correlation, weighted)
            return (self.weights[:, None, :] * mean).sum(axis=0), np.sqrt(variance)
        fused = RULES[self.rule](mean, std)
        return fused.mean, fused.std

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add all members and the rule to an ONNX graph; names of mean and std, (n, q)."""
        means, stds = [], []
        for member in self.members:
            mean, std = member.regressor.add_to_graph(graph, features)
            means.append(mean)
            stds.append(graph.op("Mul", std, graph.constant(member.std_scale)))
        if self.rule == BEST_LINEAR:
            return add_best_linear_fusion(graph, means, stds, self.weights, self.correlation)
        return add_rowwise_fusion(self.rule, graph, means, stds)


def fuse_members(members: list[CalibratedRegressor], rule: str, data: Dataset) -> Ensemble:
    """Fuse members by a rule, with the covariance of their errors on held-out rows."""
    predictions = [member.predict(data.features) for member in members]
    error = np.stack([data.targets - m for m, _ in predictions])  # (m, n, q)
    z = error / np.stack([s for _, s in predictions])
    rmse = np.sqrt(np.mean(error**2, axis=1))
    m, _, q = error.shape
    correlation = np.stack(
        [shrink_correlation(np.corrcoef(z[:, :, k]).reshape(m, m)) for k in range(q)]
    )
    weights = np.stack(
        [best_linear(rmse[:, k], rmse[:, k], correlation[k]).weights for k in range(q)],
        axis=1,
    )
    return Ensemble(tuple(members), rule, correlation, weights)
