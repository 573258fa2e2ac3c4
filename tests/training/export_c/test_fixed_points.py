"""Residuals at points of constant coordinates but one: their C against the graph in onnxruntime."""

import numpy as np
import pytest
from compiled_c import COMPILERS
from onnx import helper, numpy_helper
from test_operators import called, library, read, tensors_of

from training.export_c.fixed_points import FixedPoints, with_fixed_points
from training.export_c.functions import graph_function
from training.export_c.integrated_errors import SUMS
from training.export_c.program import Program, SharedParts
from training.export_c.tensor import Tensor
from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value
from training.set_posterior.monomials import monomial_terms
from training.set_posterior.polynomial_residuals import PolynomialResiduals, ResidualsAtFixedPoints

POINTS, ROWS = 128, 11
TERMS = monomial_terms(3, 3)
RNG = np.random.default_rng(9)
SYSTEM = RNG.normal(size=(ROWS, len(TERMS))).astype(np.float32)
OTHERS = RNG.uniform(-1.0, 1.0, (2, POINTS))


def graph_of_two_steps():
    """Two Gauss-Newton steps and the squares of the residuals where they end."""
    graph = Graph()
    system = Value(graph, "x0")
    residuals = PolynomialResiduals.solved_last(system, TERMS, (0, 2, 1))
    along = ResidualsAtFixedPoints.of(residuals, OTHERS)
    solved, precision = along.steps(2)
    solved.node("Identity").named("solved")
    precision.node("Identity").named("precision")
    squares = along.residuals(solved).sum_of_squares(axis=0, keepdims=True)
    squares.node("Identity").named("squares")
    outputs = {name: (1, [1, POINTS]) for name in ("solved", "precision", "squares")}
    return graph.model({"x0": [ROWS, len(TERMS)]}, outputs), list(outputs)


@pytest.mark.parametrize("tile", [16, 8])
def test_one_product_with_the_system_serves_all_steps(tile, tmp_path):
    if not COMPILERS:
        pytest.skip("no C compiler")
    model, outputs = graph_of_two_steps()
    shared = SharedParts()
    program = Program(shared, {}, tile)
    function = graph_function("fixed", model, program, tensors_of([SYSTEM]), outputs, True)
    assert function.text.count("solved_coefficients_float(") == 1
    compiled = library(tmp_path, [function], shared)
    found = called(compiled, function, [], {"x0": SYSTEM})
    expected = session_of(model).run(outputs, {"x0": SYSTEM})
    for name, value in zip(outputs, expected, strict=True):
        given = read(found[name], found[name][2]).reshape(1, -1)
        np.testing.assert_allclose(given, value, rtol=2e-4, atol=2e-5)


def nodes_of(change):
    """The nodes of the graph after a change of a constant, and how many sums are recognised."""
    model, _ = graph_of_two_steps()
    known = {
        c.name: Tensor.constant(numpy_helper.to_array(c).copy(), c.name)
        for c in model.graph.initializer
    }
    change(known)
    made = with_fixed_points(list(model.graph.node), known)
    return sum(node.op_type == SUMS for node in made)


def test_other_derivatives_are_not_taken_for_those_of_the_residuals():
    assert nodes_of(lambda known: None) == 2

    def other_factors(known):
        (name,) = (k for k, t in known.items() if t.rank == 1 and t.value.dtype == np.float32
                   and len(t.value) > 1)  # fmt: skip
        known[name] = Tensor.constant(known[name].value + 1.0, name)

    assert nodes_of(other_factors) == 1  # that at zero


def test_values_of_other_kinds_are_no_monomials():
    node = helper.make_node
    nodes = [
        node("Exp", ["x"], ["y"]),
        node("Mul", ["s", "t"], ["two_unknowns"]),
        node("Concat", ["c", "c"], ["columns"], axis=1),
    ]
    known = {"c": Tensor.constant(np.ones((2, 3), np.float32), "c")}
    points = FixedPoints(nodes, known)
    assert [points.monomials(name) for name in ("y", "two_unknowns", "columns")] == [None] * 3
    assert points.monomials("s").powers.tolist() == [1]
