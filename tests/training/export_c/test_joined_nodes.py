"""Nodes of a graph that become one operator of C, by hand; others stay as they are."""

import numpy as np
from onnx import helper, numpy_helper

from training.export_c.integrated_errors import FACTOR, INTEGRATION, ROWS, SUMS
from training.export_c.joined_nodes import joined
from training.export_c.tensor import Tensor
from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value
from training.set_posterior.sensor_errors import integrate_out_errors

node = helper.make_node


def known_of(**values):
    return {name: Tensor.constant(np.asarray(value), name) for name, value in values.items()}


def kinds(nodes):
    return [n.op_type for n in nodes]


def test_products_of_picked_rows_are_one_node():
    nodes = [
        node("Gather", ["x", "left"], ["l"], axis=0),
        node("Gather", ["x", "right"], ["r"], axis=0),
        node("Mul", ["l", "r"], ["y"]),
    ]
    (made,) = joined(nodes, known_of(left=[0, 1], right=[1, 1]), ["y"])
    assert (made.op_type, list(made.input)) == (ROWS, ["x", "left", "right"])


def test_rows_of_two_matrices_stay_apart():
    nodes = [
        node("Gather", ["x", "left"], ["l"], axis=0),
        node("Gather", ["z", "right"], ["r"], axis=0),
        node("Mul", ["l", "r"], ["y"]),
    ]
    made = joined(nodes, known_of(left=[0, 1], right=[1, 1]), ["y"])
    assert kinds(made) == ["Gather", "Gather", "Mul"]


def test_a_sum_of_squares_needs_no_product():
    nodes = [node("Mul", ["x", "x"], ["p"]), node("ReduceSum", ["p", "axis"], ["y"], keepdims=0)]
    (made,) = joined(nodes, known_of(axis=[1]), ["y"])
    assert (made.op_type, list(made.input)) == ("ReduceSumSquare", ["x", "axis"])
    assert [one.name for one in made.attribute] == ["keepdims"]
    both = joined(nodes, known_of(axis=[1]), ["y", "p"])
    assert "Mul" in kinds(both)  # a product that is an output stays


def gauss_newton(basis, slope_basis):
    return [
        node("Gather", ["a", "picked"], ["columns"], axis=1),
        node("Mul", ["columns", "factors"], ["slope"]),
        node("MatMul", ["a", basis], ["residual"]),
        node("MatMul", ["slope", slope_basis], ["change"]),
        node("ReduceSumSquare", ["change", "rows"], ["squares"], keepdims=1),
        node("Mul", ["residual", "change"], ["product"]),
        node("ReduceSum", ["product", "rows"], ["sums"], keepdims=1),
    ]


def test_sums_of_a_gauss_newton_step_are_one_node_of_fewer_rows():
    known = known_of(picked=[2, 0], factors=np.float32([1.0, 2.0]), rows=[0])
    made = joined(gauss_newton("b", "d"), known, ["squares", "sums"])
    assert kinds(made) == [SUMS]
    assert list(made[0].input) == ["a", "b", "a", "d", "picked", "factors"]
    made = joined([node("Neg", ["given"], ["a"]), *gauss_newton("b", "d")], known, ["sums"])
    assert kinds(made) == ["Neg", FACTOR, SUMS]
    assert list(made[2].input[:3]) == ["a_factor", "b", "a_factor"]


def test_what_is_computed_twice_is_computed_once():
    nodes = [
        node("Exp", ["x"], ["one"]),
        node("Exp", ["x"], ["two"]),
        node("Exp", ["x"], ["kept"]),
        node("Add", ["one", "two"], ["y"]),
    ]
    made = joined(nodes, {}, ["y", "kept"])
    assert [list(n.input) for n in made] == [["x"], ["x"], ["one", "one"]]
    assert [n.output[0] for n in made] == ["one", "kept", "y"]


def integration(errors):
    """Nodes that integrate out errors of a system (9, 4 + errors), constants, and the result."""
    graph = Graph()
    made = integrate_out_errors(Value(graph, "system"), 4, errors)
    model = graph.model({"system": [9, 4 + errors]}, {made.name: (1, [9, 4])})
    constants = {c.name: numpy_helper.to_array(c) for c in model.graph.initializer}
    return list(model.graph.node), known_of(**constants), made.name


def test_errors_that_are_integrated_out_in_turn_are_one_node():
    nodes, known, result = integration(3)
    (found,) = joined(nodes, known, [result])
    assert (found.op_type, list(found.input)) == (INTEGRATION, ["system"])
    assert found.output[0] == result and found.attribute[0].i == 3


def test_errors_of_which_a_step_is_read_elsewhere_stay_apart():
    nodes, known, result = integration(1)
    nodes.append(node("Neg", [nodes[1].output[0]], ["also"]))
    assert INTEGRATION not in kinds(joined(nodes, known, [result, "also"]))
