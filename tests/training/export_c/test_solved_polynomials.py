"""Residuals by powers of the solved coordinate: the compiled C against the equations in numpy."""

import numpy as np
import pytest
from compiled_c import COMPILERS
from onnx import helper, numpy_helper
from test_operators import called, library, read, tensors_of

from training.export_c.functions import graph_function
from training.export_c.integrated_errors import APART, FACTOR, ROWS, SQUARES, SUMS
from training.export_c.program import Program, SharedParts

RNG = np.random.default_rng(5)
POINTS = 128
#: 1, two other coordinates and the solved one; products of two, and of two of these.
LEFT, RIGHT = np.array([0, 0, 0, 1, 2, 3]), np.array([0, 1, 3, 2, 3, 3])
FIRST, SECOND = np.array([0, 2, 5, 3, 5, 1, 4]), np.array([0, 0, 0, 1, 5, 1, 5])
POWERS = np.array([0, 1, 2, 0, 4, 0, 3])
SYSTEM = RNG.normal(size=(21, 7)).astype(np.float32)
ERRORS = RNG.normal(size=(21, 2)).astype(np.float32)
SIZES = np.array([[[0.5, 1.0]], [[2.0, 0.1]]], np.float32)
OTHERS = np.concatenate([np.ones((1, POINTS)), RNG.uniform(-1, 1, (2, POINTS))]).astype(np.float32)
SOLVED = RNG.uniform(-1, 1, (1, POINTS)).astype(np.float32)
SLOPES = np.flatnonzero(POWERS)
CONSTANTS = {
    "ones": OTHERS[:1],
    "left": LEFT,
    "right": RIGHT,
    "first": FIRST,
    "second": SECOND,
    "picked": SLOPES,
    "powers": POWERS[SLOPES].astype(np.float32),
    "rows": np.array([0]),
}


def monomials_at(solved):
    points = np.concatenate([OTHERS, solved])
    pairs = points[LEFT] * points[RIGHT]
    return pairs[FIRST] * pairs[SECOND]


def slopes_at(solved):
    """Derivatives of the monomials over their powers."""
    return np.where(POWERS[:, None] > 0, monomials_at(np.ones_like(solved)), 0.0)[SLOPES] * (
        solved ** (POWERS[SLOPES] - 1)[:, None]
    )


@pytest.fixture(scope="module", params=[16, 8])
def made(request, tmp_path_factory):
    """The text of a C function, and its outputs by name; with 16 and with 8 points at a time."""
    if not COMPILERS:
        pytest.skip("no C compiler")
    constants = CONSTANTS | {"slopes": slopes_at(SOLVED).astype(np.float32)}
    node = helper.make_node
    nodes = [
        node("Concat", ["ones", "others", "solved"], ["points"], axis=0),
        node(ROWS, ["points", "left", "right"], ["pairs"]),
        node(ROWS, ["pairs", "first", "second"], ["basis"]),
        node(SUMS, ["system", "basis", "system", "slopes", "picked", "powers"], ["s1", "p1"]),
        node("MatMul", ["system", "basis"], ["residuals"]),
        node("ReduceSumSquare", ["residuals", "rows"], ["squares"], keepdims=1),
        node(APART, ["system", "errors", "sizes"], ["apart", "shares", "e0", "e1"], errors=2),
        node(FACTOR, ["apart"], ["rest", "top"], skipped=2),
        node(SQUARES, ["top", "shares", "rest", "basis"], ["by_scale"]),
    ]
    given = {
        "system": SYSTEM,
        "others": OTHERS[1:],
        "solved": SOLVED,
        "errors": ERRORS,
        "sizes": SIZES,
    }
    outputs = ["s1", "p1", "squares", "by_scale"]
    names = dict(zip((f"x{i}" for i in range(len(given))), given, strict=True))
    back = {name: x for x, name in names.items()}
    for one in nodes:
        one.input[:] = [back.get(name, name) for name in one.input]
    inputs = [helper.make_tensor_value_info(x, 1, given[name].shape) for x, name in names.items()]
    fixed = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    ends = [helper.make_empty_tensor_value_info(name) for name in outputs]
    model = helper.make_model(
        helper.make_graph(nodes, "solved", inputs, ends, fixed),
        opset_imports=[helper.make_opsetid("", 18)],
    )
    shared, values = SharedParts(), list(given.values())
    program = Program(shared, {}, request.param)
    function = graph_function("solved", model, program, tensors_of(values), outputs, True)
    compiled = library(tmp_path_factory.mktemp("c"), [function], shared)
    found = called(compiled, function, [], dict(zip(names, values, strict=True)))
    return function.text, {name: read(output, output[2]) for name, output in found.items()}


def test_one_product_with_the_system_serves_all(made):
    text, _ = made
    assert text.count("solved_coefficients_float(") == 3  # all rows; first rows; the others
    assert "gauss_newton_sums" not in text


def test_sums_of_steps_and_squares(made):
    _, found = made
    residuals = SYSTEM @ monomials_at(SOLVED)
    slope = (SYSTEM[:, SLOPES] * POWERS[SLOPES]) @ slopes_at(SOLVED)
    np.testing.assert_allclose(found["s1"], (slope**2).sum(axis=0), rtol=1e-4)
    expected = (residuals * slope).sum(axis=0)
    np.testing.assert_allclose(found["p1"], expected, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(found["squares"], (residuals**2).sum(axis=0), rtol=1e-4)


def test_squares_of_each_scale_of_the_errors(made):
    _, found = made
    residuals = SYSTEM @ monomials_at(SOLVED)
    for scale, size in enumerate(SIZES[:, 0]):
        whole = np.eye(len(SYSTEM)) + (ERRORS * size) @ (ERRORS * size).T
        expected = (residuals * np.linalg.solve(whole, residuals)).sum(axis=0)
        np.testing.assert_allclose(found["by_scale"].reshape(2, -1)[scale], expected, rtol=1e-3)
