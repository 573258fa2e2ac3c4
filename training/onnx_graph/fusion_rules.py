"""The fusion rules of `soilml.numerics.estimate_fusion` as nodes of an ONNX graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value, concat, reciprocal, sqrt

Floats = NDArray[np.float64]


def add_best_linear_fusion(
    graph: Graph, means: list[str], stds: list[str], weights: Floats, correlation: Floats
) -> tuple[str, str]:
    r"""The linear combination of m estimates with fixed weights.

    .. math:: \mu = \sum_i w_i \mu_i, \qquad
        \sigma^2 = \sum_i \sum_j w_i w_j \sigma_i \sigma_j \rho_{ij}

    Parameters
    ----------
    graph : Graph
        The graph to which nodes are added.
    means, stds : list of str
        Names of the m estimates and their standard deviations, (n, q) each.
    weights : ndarray
        Weights (m, q).
    correlation : ndarray
        Correlation (q, m, m) of the errors.

    Returns
    -------
    tuple of str
        Names of mean and standard deviation (n, q).
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

    Parameters
    ----------
    rule : str
        One of `soilml.numerics.estimate_fusion.RULES`.
    graph : Graph
        The graph to which nodes are added.
    means, stds : list of str
        Names of the m estimates and their standard deviations, (n, q) each.

    Returns
    -------
    tuple of str
        Names of the fused mean and standard deviation (n, q).
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
