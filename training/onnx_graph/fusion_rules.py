"""The fusion rules of `soilml.numerics.estimate_fusion` as nodes of an ONNX graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph

Floats = NDArray[np.float64]


def draw_best_linear(
    graph: Graph, means: list[str], stds: list[str], weights: Floats, correlation: Floats
) -> tuple[str, str]:
    """Fixed weights (m, q) and the errors' correlation (q, m, m): names of mean and std (n, q)."""
    m = len(means)
    weighed = [graph.op("Mul", x, graph.constant(weights[i])) for i, x in enumerate(means)]
    mean = graph.op("Sum", *weighed)
    spread = [graph.op("Mul", s, graph.constant(weights[i])) for i, s in enumerate(stds)]
    terms = []
    for i in range(m):
        for j in range(i, m):
            factor = correlation[:, i, j] * (1.0 if i == j else 2.0)
            product = graph.op("Mul", spread[i], spread[j])
            terms.append(graph.op("Mul", product, graph.constant(factor)))
    return mean, graph.op("Sqrt", graph.op("Sum", *terms))


def draw_rule(rule: str, graph: Graph, means: list[str], stds: list[str]) -> tuple[str, str]:
    """A rule that weighs row by row: names of the fused mean and std (n, q)."""
    axis = graph.constant(np.asarray([1], dtype=np.int64))
    mean = graph.op("Concat", *[graph.op("Unsqueeze", m, axis) for m in means], axis=1)
    std = graph.op("Concat", *[graph.op("Unsqueeze", s, axis) for s in stds], axis=1)
    precision = graph.op("Reciprocal", std)  # (n, m, q)
    information = graph.op("Mul", precision, precision)
    m = len(means)
    if rule in ("inverse-variance", "covariance-intersection"):
        total = graph.reduced("ReduceSum", information, 1, keep=True)
        weights = graph.op("Div", information, total)
        share = 1.0 if rule == "inverse-variance" else 1.0 / m
        variance = graph.op("Reciprocal", graph.op("Mul", total, graph.constant(share)))
    else:
        weights, variance = _pairwise(graph, std, m)
    fused = graph.reduced("ReduceSum", graph.op("Mul", weights, mean), 1)
    return fused, graph.op("Sqrt", graph.reduced("ReduceSum", variance, 1))


def _pairwise(graph: Graph, std: str, m: int) -> tuple[str, str]:
    square = graph.op("Mul", std, std)  # (n, m, q)
    own = graph.op("Unsqueeze", square, graph.constant(np.asarray([2], dtype=np.int64)))
    other = graph.op("Unsqueeze", square, graph.constant(np.asarray([1], dtype=np.int64)))
    shares = graph.op("Div", other, graph.op("Add", own, other))  # (n, i, j, q)
    summed = graph.reduced("ReduceSum", shares, 2)
    # the diagonal of shares is one half
    pairs = graph.op("Sub", summed, graph.constant(0.5))
    weights = graph.op("Mul", pairs, graph.constant(2.0 / (m * (m - 1))))
    spread = graph.op("Mul", graph.op("Mul", weights, weights), square)
    return weights, graph.reduced("ReduceSum", spread, 1, keep=True)
