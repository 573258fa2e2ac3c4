"""Several regressors of the same row, fused into one estimate, in numpy and in an ONNX graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.fusion_rules import BEST_LINEAR, RULES, best_linear, shrink_correlation
from training.calibration.recalibration import CalibratedRegressor
from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value, concat, reciprocal, sqrt

#: Rows of which correlations are shrunk entirely; by a share of this number over theirs beyond.
SHRUNK_ROWS = 10.0


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
        means, stds = zip(*(member.predict(features) for member in self.members), strict=True)
        return self.combine(np.stack(means), np.stack(stds))

    def combine(self, mean: Floats, std: Floats) -> tuple[Floats, Floats]:
        """The same from the members' means and standard deviations (m, n, q)."""
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


def fuse_members(
    members: list[CalibratedRegressor], rule: str, mean: Floats, std: Floats, truth: Floats
) -> Ensemble:
    """Fuse members by a rule, with the covariance of their errors.

    mean, std (m, n, q): Their estimates of rows that they have not seen, whose true values are
        `truth` (n, q).
    """
    error = truth - mean
    z = error / std
    rmse = np.sqrt(np.mean(error**2, axis=1))
    m, _, q = error.shape
    share = min(0.1, SHRUNK_ROWS / len(truth))
    correlation = np.stack(
        [shrink_correlation(np.corrcoef(z[:, :, k]).reshape(m, m), share) for k in range(q)]
    )
    weights = np.stack(
        [best_linear(rmse[:, k], rmse[:, k], correlation[k]).weights for k in range(q)], axis=1
    )
    return Ensemble(tuple(members), rule, correlation, weights)


def add_best_linear_fusion(
    graph: Graph, means: list[str], stds: list[str], weights: Floats, correlation: Floats
) -> tuple[str, str]:
    r"""The linear combination of m estimates with fixed weights.

    .. math:: \mu = \sum_i w_i \mu_i, \qquad
        \sigma^2 = \sum_i \sum_j w_i w_j \sigma_i \sigma_j \rho_{ij}

    graph: The graph to which nodes are added.
    means, stds: Names of the m estimates and their standard deviations, (n, q) each.
    weights: Weights (m, q).
    correlation: Correlation (q, m, m) of the errors.

    Returns: Names of mean and standard deviation (n, q).
    """
    mean, std = (concat(_doubles(graph, values), axis=1) for values in (means, stds))  # (n, m q)
    m, q = weights.shape
    # one product sums estimates, and one the products of all pairs of their standard deviations
    quantity = np.arange(q)
    first, second = np.triu_indices(m)
    columns = np.arange(m * q).reshape(m, q)
    of_pairs = np.zeros((len(first), q, q))
    multiplicity = np.where(first == second, 1.0, 2.0)  # the pairs (i, j) and (j, i)
    of_pairs[:, quantity, quantity] = (
        weights[first] * weights[second] * correlation[:, first, second].T * multiplicity[:, None]
    )
    left, right = (std.take(columns[k].reshape(-1).tolist(), axis=1) for k in (first, second))
    variance = (left * right) @ of_pairs.reshape(-1, q)
    of_estimates = (weights[:, :, None] * np.eye(q)).reshape(-1, q)
    return (mean @ of_estimates).name, sqrt(variance).name


def add_rowwise_fusion(
    rule: str, graph: Graph, means: list[str], stds: list[str]
) -> tuple[str, str]:
    r"""A fusion rule whose weights follow from the standard deviations of each row.

    With the information of an estimate :math:`I_i = \sigma_i^{-2}`, the weights of the rules
    inverse-variance and covariance-intersection are :math:`I_i / \sum_j I_j`; the variances are
    :math:`1 / \sum_j I_j` and :math:`m / \sum_j I_j`. Any other rule is the mean of all pairs.

    rule: One of `soilml.onboard.fusion_rules.RULES`.
    graph: The graph to which nodes are added.
    means, stds: Names of the m estimates and their standard deviations, (n, q) each.

    Returns: Names of the fused mean and standard deviation (n, q).
    """
    mean_values, std_values = _doubles(graph, means), _doubles(graph, stds)
    axis = mean_values[0].indices([1])
    mean = concat([value.node("Unsqueeze", axis) for value in mean_values], axis=1)  # (n, m, q)
    std = concat([value.node("Unsqueeze", axis) for value in std_values], axis=1)
    precision = reciprocal(std)
    information = precision * precision
    m = len(means)
    if rule in ("inverse-variance", "covariance-intersection"):
        total = information.sum(axis=1, keepdims=True)
        weights = information / total
        share = 1.0 if rule == "inverse-variance" else 1.0 / m
        variance = reciprocal(total * share)
    else:
        weights, variance = _pairwise_fusion(std, m)
    fused = (weights * mean).sum(axis=1, keepdims=False)
    return fused.name, sqrt(variance.sum(axis=1, keepdims=False)).name


def _pairwise_fusion(std: Value, m: int) -> tuple[Value, Value]:
    """Weights (n, m, q) and variance (n, 1, q) of the mean of all pairs' best combinations."""
    variance = std * std
    first = variance.node("Unsqueeze", variance.indices([2]))
    second = variance.node("Unsqueeze", variance.indices([1]))
    shares = second / (first + second)  # (n, i, j, q)
    # each estimate is paired with itself as well, with a share of one half, which is taken off
    weights = (shares.sum(axis=2, keepdims=False) - 0.5) * (2.0 / (m * (m - 1)))
    return weights, (weights * weights * variance).sum(axis=1, keepdims=True)


def _doubles(graph: Graph, names: list[str]) -> list[Value]:
    return [Value(graph, name, np.float64) for name in names]
