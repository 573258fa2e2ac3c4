"""Operators on values compute what numpy computes, and append one node each."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import (
    Value,
    absolute,
    asinh,
    concat,
    exp,
    floor,
    gemm,
    log,
    maximum,
    minimum,
    reciprocal,
    softmax,
    sqrt,
    tanh,
    where,
)

X = np.asarray([[0.5, 1.5, 2.5], [3.0, 0.25, 1.0]], np.float32)
EXPRESSIONS = {
    "2 x + 1": (lambda x: 2.0 * x + 1.0, lambda x: 2.0 * x + 1.0),
    "1 - x / 2": (lambda x: 1.0 - x / 2.0, lambda x: 1.0 - x / 2.0),
    "1 / -x": (lambda x: 1.0 / -x, lambda x: 1.0 / -x),
    "array - x": (lambda x: np.ones(3) - x, lambda x: np.ones(3) - x),
    "array / x": (lambda x: np.ones(3) / x, lambda x: np.ones(3) / x),
    "x @ array": (lambda x: x @ np.ones((3, 2)), lambda x: x @ np.ones((3, 2))),
    "array @ x": (lambda x: np.ones((3, 2)) @ x, lambda x: np.ones((3, 2)) @ x),
    "functions": (
        lambda x: exp(log(x)) + sqrt(x) * tanh(x) + absolute(-x) + floor(x) + asinh(reciprocal(x)),
        lambda x: x + np.sqrt(x) * np.tanh(x) + x + np.floor(x) + np.arcsinh(1.0 / x),
    ),
    "limits": (
        lambda x: maximum(x, 1.0) + minimum(x, 1.0) + x.clip(0.4, 0.6) + x.clip(2.0),
        lambda x: np.maximum(x, 1.0) + np.minimum(x, 1.0) + x.clip(0.4, 0.6) + x.clip(2.0),
    ),
    "where": (
        lambda x: where((x < 1.0) | (x >= 2.5) & ~(x > 2.9), x, 0.0),
        lambda x: np.where((x < 1.0) | (x >= 2.5) & ~(x > 2.9), x, 0.0),
    ),
    "sums": (
        lambda x: x.sum(axis=1, keepdims=True) + x.sum_of_squares(axis=0, keepdims=True) + x.sum(),
        lambda x: x.sum(axis=1, keepdims=True) + (x**2).sum(axis=0, keepdims=True) + x.sum(),
    ),
    "softmax": (
        lambda x: softmax(x, axis=1),
        lambda x: np.exp(x) / np.exp(x).sum(axis=1, keepdims=True),
    ),
    "entries": (
        lambda x: concat([x.take([1, 0], axis=0), *x.reshape(2, 3).split([1, 2], axis=1)], axis=1),
        lambda x: np.concatenate([x[[1, 0]], x], axis=1),
    ),
    "parts": (lambda x: x.split(2, axis=0)[1], lambda x: x[1:]),
    "largest": (lambda x: x.largest(2, axis=1), lambda x: -np.sort(-x, axis=1)[:, :2]),
    "gemm": (
        lambda x: gemm(x, x, np.ones(2), transpose_b=True, alpha=-2.0),
        lambda x: -2.0 * x @ x.T + 1.0,
    ),
    "types": (
        lambda x: (x <= 1.0).astype(np.int32).reduce("ReduceMax", axis=0).astype(np.float32),
        lambda x: (x <= 1.0).any(axis=0, keepdims=True).astype(np.float32),
    ),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_an_expression_computes_what_numpy_computes(name):
    of_values, of_arrays = EXPRESSIONS[name]
    graph = Graph()
    of_values(Value(graph, "x")).node("Identity").named("y")
    session = session_of(graph.model({"x": [2, 3]}, {"y": (1, [None, None])}))
    assert session.run(None, {"x": X})[0] == pytest.approx(of_arrays(X), rel=1e-6)
