"""Graphs hold nothing twice and nothing that no output needs, and take shortcuts where they are."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, constant, shortcut


def test_what_no_output_needs_is_left_out():
    graph = Graph()
    x = Value(graph, "x")
    unused = constant(graph, np.arange(4.0)) * x
    (x + 1.0).named("y")
    model = graph.model({"x": [1]}, {"y": (1, [1])})
    assert [node.op_type for node in model.graph.node] == ["Add"]
    assert unused.name not in {node.output[0] for node in model.graph.node}
    assert len(model.graph.initializer) == 1


@pytest.fixture
def model():
    """y is x where the sum of x is not positive, else x + 2, within two branches."""
    graph = Graph()
    x = Value(graph, "x")

    def general(inner: Value) -> Value:
        return shortcut(inner.sum() <= 100.0, lambda v: v + 2.0, lambda v: v + 3.0, inner)

    (shortcut(x.sum() <= 0.0, lambda v: v, general, x) * 1.5).named("y")
    return graph.model({"x": [2]}, {"y": (1, [2])})


@pytest.mark.parametrize("x", [(-1.0, 0.5), (1.0, 0.5), (99.0, 2.0)])
def test_a_shortcut_is_taken_where_its_condition_is_true(model, x):
    added = 0.0 if sum(x) <= 0.0 else 2.0 if sum(x) <= 100.0 else 3.0
    found = session_of(model).run(None, {"x": np.asarray(x, np.float32)})[0]
    assert found == pytest.approx(1.5 * (np.asarray(x) + added))
