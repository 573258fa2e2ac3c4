"""Operators that stand for several nodes: the compiled C against numpy, by the equations."""

import numpy as np
import pytest
from compiled_c import COMPILERS
from onnx import helper, numpy_helper
from test_operators import called, library, read, tensors_of

from training.export_c.functions import graph_function
from training.export_c.integrated_errors import (
    APART,
    FACTOR,
    INTEGRATION,
    MEAN,
    ROWS,
    SQUARES,
    SUMS,
)
from training.export_c.operators import together
from training.export_c.program import Program, SharedParts

RNG = np.random.default_rng(4)
POINTS, TERMS, ERRORS = 16, 5, 2


def random(*shape):
    return RNG.normal(size=shape).astype(np.float32)


#: Inputs by name: systems with more and with fewer rows than they have columns, and points.
MANY, FEW, OTHER, BASIS = random(30, TERMS), random(3, TERMS), random(7, TERMS), random(6, POINTS)
LARGE = random(30, TERMS + ERRORS)
COLUMNS, SIZES = random(30, ERRORS), np.abs(random(3, 1, ERRORS))
MONOMIALS, SLOPES = random(TERMS, POINTS), random(2, POINTS)
SHARES = np.array([[0.2, 0.3, 0.5]], np.float32)
GIVEN = [MANY, FEW, OTHER, BASIS, LARGE, COLUMNS, SIZES, MONOMIALS, SLOPES, SHARES]
NAMES = [f"x{i}" for i in range(len(GIVEN))]
many, few, other, basis, large, columns, sizes, monomials, slopes, shares = NAMES
CONSTANTS = {
    "left": np.array([0, 2, 5]),
    "right": np.array([1, 2, 3]),
    "picked": np.array([4, 1]),
    "factors": np.array([2.0, -0.5], np.float32),
    "rows": np.array([0]),
    "one_empty": COLUMNS * np.array([0.0, 1.0], np.float32),
}
NODES = [
    helper.make_node(ROWS, [basis, "left", "right"], ["products"]),
    helper.make_node(
        SUMS,
        [many, monomials, many, slopes, "picked", "factors", few, other],
        ["squares", "gradients"],
    ),
    helper.make_node(INTEGRATION, [large], ["integrated", "d0", "d1"], errors=ERRORS),
    helper.make_node(FACTOR, [many], ["factor", "none"], skipped=0),
    helper.make_node("MatMul", ["factor", monomials], ["of_factor"]),
    helper.make_node("ReduceSumSquare", ["of_factor", "rows"], ["of_rows"], keepdims=1),
    helper.make_node(APART, [many, columns, sizes], ["apart", "matrices", "e0", "e1"],
                     errors=ERRORS),
    helper.make_node(FACTOR, ["apart"], ["rest", "top"], skipped=ERRORS),
    helper.make_node(SQUARES, ["top", "matrices", "rest", monomials], ["by_scale"]),
    helper.make_node(MEAN, ["top", "matrices", shares], ["mean"]),
    helper.make_node(APART, [many, "one_empty", sizes], ["apart_0", "matrices_0", "n0", "n1"],
                     errors=ERRORS),
    helper.make_node(FACTOR, ["apart_0"], ["rest_0", "top_0"], skipped=ERRORS),
    helper.make_node(SQUARES, ["top_0", "matrices_0", "rest_0", monomials], ["without_one"]),
]  # fmt: skip
OUTPUTS = ["products", "squares", "gradients", "integrated", "d0", "d1", "of_rows", "matrices",
           "e0", "e1", "top", "by_scale", "mean", "without_one"]  # fmt: skip


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Outputs of one C function with all operators, by name."""
    if not COMPILERS:
        pytest.skip("no C compiler")
    inputs = [
        helper.make_tensor_value_info(n, 1, x.shape) for n, x in zip(NAMES, GIVEN, strict=True)
    ]
    fixed = [numpy_helper.from_array(value, name) for name, value in CONSTANTS.items()]
    ends = [helper.make_empty_tensor_value_info(name) for name in OUTPUTS]
    graph = helper.make_graph(NODES, "joined", inputs, ends, fixed)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)])
    shared = SharedParts()
    function = graph_function("joined", model, Program(shared, {}), tensors_of(GIVEN), OUTPUTS)
    compiled = library(tmp_path_factory.mktemp("c"), [function], shared)
    feed = dict(zip(NAMES, GIVEN, strict=True))
    outputs = called(compiled, function, [], feed)
    return {name: read(output, output[2]) for name, output in outputs.items()}


def agrees(found, expected):
    np.testing.assert_allclose(found, np.ravel(expected), rtol=2e-4, atol=2e-4)


def test_every_joined_operator_is_computed_here():
    assert {node.op_type for node in NODES} >= set(together.OPERATORS)


def test_products_of_rows(found):
    agrees(found["products"], BASIS[CONSTANTS["left"]] * BASIS[CONSTANTS["right"]])


def _step(system):
    """Squares of the derivatives of residuals, and their products with these, (rows, points)."""
    slope = (system[:, CONSTANTS["picked"]] * CONSTANTS["factors"]) @ SLOPES
    return slope**2, (system @ MONOMIALS) * slope


def test_sums_of_a_gauss_newton_step(found):
    """Of systems with an even and an odd number of rows."""
    expected = [
        sum(part.sum(axis=0) for part in parts)
        for parts in zip(*(_step(system) for system in (MANY, FEW, OTHER)), strict=True)
    ]
    agrees(found["squares"], expected[0])
    agrees(found["gradients"], expected[1])


def test_errors_integrated_out_one_after_another(found):
    """A'^T A' = A^T (I + G G^T)^-1 A, and the determinants multiply to that of I + G G^T."""
    system, errors = LARGE[:, :TERMS], LARGE[:, TERMS:]
    whole = np.eye(len(LARGE)) + errors @ errors.T
    made = found["integrated"].reshape(-1, TERMS)
    agrees(np.ravel(made.T @ made), system.T @ np.linalg.solve(whole, system))
    agrees(found["d0"] * found["d1"], [np.linalg.det(whole)])


def test_fewer_rows_have_the_same_sums_of_squares(found):
    agrees(found["of_rows"], ((MANY @ MONOMIALS) ** 2).sum(axis=0))


@pytest.mark.parametrize(
    ("name", "columns"), [("by_scale", COLUMNS), ("without_one", CONSTANTS["one_empty"])]
)
def test_errors_apart_have_the_squares_of_each_scale(found, name, columns):
    """Also where no reading has one of the errors."""
    for scale, size in enumerate(SIZES[:, 0]):
        errors = columns * size
        whole = np.eye(len(MANY)) + errors @ errors.T
        residuals = MANY @ MONOMIALS
        expected = (residuals * np.linalg.solve(whole, residuals)).sum(axis=0)
        agrees(found[name].reshape(3, -1)[scale], expected)
        if name == "by_scale":
            agrees(found["e0"][scale] * found["e1"][scale], np.linalg.det(whole))


def test_the_mean_of_scales_is_that_of_the_first_rows(found):
    matrices = found["matrices"].reshape(3, ERRORS, ERRORS)
    mean = np.einsum("s,sij->ij", SHARES[0], matrices)
    agrees(found["mean"], mean @ found["top"].reshape(ERRORS, TERMS))
