"""Graphs hold nothing twice and nothing that no output needs, and take shortcuts where they are."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, constant, shortcut, shortcuts


def test_a_constant_and_a_node_are_added_once():
    graph = Graph()
    x = Value(graph, "x")
    assert graph.constant(np.ones(3)) == graph.constant(np.ones(3))
    assert graph.constant(np.ones(3)) != graph.constant(np.ones((3, 1)))
    assert ((x + 2.0) * 3.0).name == ((x + 2.0) * 3.0).name
    assert x.node("ReduceSum", keepdims=0).name != x.node("ReduceSum", keepdims=1).name


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


def two_ways(quick):
    """Two values of x, both from one If node."""
    graph = Graph()
    x = Value(graph, "x")
    given = {"x": x, "also": (x + 1.0,)}  # a branch reads values within collections
    first, second = shortcuts(x.sum() <= 0.0, quick, lambda g: [g["x"], g["also"][0] * 3.0], given)
    first.node("Identity").named("y")
    second.node("Identity").named("z")
    return graph.model({"x": [1]}, {"y": (1, [1]), "z": (1, [1])})


@pytest.mark.parametrize("x, expected", [(-1.0, (0.0, -1.0)), (2.0, (2.0, 9.0))])
def test_a_shortcut_has_several_values(x, expected):
    model = two_ways(lambda g: [g["also"][0], g["x"]])
    assert [node.op_type for node in model.graph.node].count("If") == 1
    found = session_of(model).run(None, {"x": np.asarray([x], np.float32)})
    assert tuple(float(value[0]) for value in found) == expected
