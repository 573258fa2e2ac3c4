"""Graphs: operators and factors compute what numpy computes; composites."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import (
    Value,
    absolute,
    asinh,
    cholesky_columns,
    composite,
    concat,
    constant,
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


def test_what_no_output_needs_is_left_out():
    graph = Graph()
    x = Value(graph, "x")
    unused = constant(graph, np.arange(4.0)) * x
    (x + 1.0).named("y")
    model = graph.model({"x": [1]}, {"y": (1, [1])})
    assert [node.op_type for node in model.graph.node] == ["Add"]
    assert unused.name not in {node.output[0] for node in model.graph.node}
    assert len(model.graph.initializer) == 1


def test_a_composite_is_a_local_function_that_may_be_called_again():
    def twice(x: Value) -> list[Value]:
        return [x + x, x * 2.0 + 1.0]

    graph = Graph()
    double, more = composite("Twice", ["double", "more"], twice, x=Value(graph, "x"))
    composite("Twice", ["double", "more"], twice, x=double + more)[0].node("Identity").named("y")
    model = graph.model({"x": [2]}, {"y": (1, [2])})
    assert [function.name for function in model.functions] == ["Twice"]
    x = np.asarray([1.0, -0.5], np.float32)
    assert session_of(model).run(None, {"x": x})[0] == pytest.approx(8.0 * x + 2.0)
    with pytest.raises(ValueError, match="another function Twice"):
        composite("Twice", ["double"], lambda x: [x], x=double)


@pytest.mark.parametrize("p", [2, 4, 6])
def test_the_factor_of_moments_is_that_of_numpy(p):
    rng = np.random.default_rng(p)
    points = np.concatenate([np.ones((50, 1)), rng.normal(0.3, 0.4, (50, p - 1))], axis=1)
    moments = points.T @ points / 50.0
    graph = Graph()
    cholesky_columns(Value(graph, "moments"), p).named("factor")
    session = session_of(graph.model({"moments": [p, p]}, {"factor": (1, [p, p])}))
    found = session.run(None, {"moments": moments.astype(np.float32)})[0]
    assert found == pytest.approx(np.linalg.cholesky(moments), abs=1e-4)
    assert found[:, 0] == pytest.approx(points.mean(axis=0), abs=1e-6)
