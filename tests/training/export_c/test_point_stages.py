"""Nodes that treat points one by one become stages, by hand."""

import numpy as np
from onnx import helper

from training.export_c.point_stages import PointStage, in_stages, with_late_copies
from training.export_c.tensor import Tensor, shape_of

node = helper.make_node
POINTS = 256


def known_of(constants, **shapes):
    """Values by name: constants, and others of a shape."""
    known = {name: Tensor.constant(np.asarray(v), name) for name, v in constants.items()}
    return known | {name: Tensor(name, "float", shape_of(s)) for name, s in shapes.items()}


def names(step):
    return [n.output[0] for n in step.nodes] if isinstance(step, PointStage) else step.output[0]


def test_points_are_treated_in_one_stage_until_all_are_needed():
    nodes = [
        node("MatMul", ["a", "x"], ["p"]),
        node("Tanh", ["p"], ["t"]),
        node("Softmax", ["t"], ["w"], axis=1),  # of all points
        node("Mul", ["t", "w"], ["y"]),
    ]
    whole = (4, POINTS)
    known = known_of({}, a=(4, 3), x=(3, POINTS), p=whole, t=whole, w=whole, y=whole)
    stage, *others = in_stages(nodes, known, ["y"])
    assert names(stage) == ["p", "t"] and [names(step) for step in others] == ["w", "y"]
    assert (stage.points, stage.tiled, stage.outputs) == (POINTS, ("x",), ("t",))


def test_few_points_and_transposed_ones_are_no_stage():
    few = known_of({}, a=(4, 3), x=(3, 32), y=(4, 32))
    nodes = [node("MatMul", ["a", "x"], ["y"])]
    assert in_stages(nodes, few, ["y"]) == nodes
    many = known_of({}, a=(4, 3), x=(POINTS, 3), y=(4, POINTS))
    nodes = [node("Gemm", ["a", "x"], ["y"], transB=1)]
    assert in_stages(nodes, many, ["y"]) == nodes


def test_constants_with_a_row_of_points_are_joined_where_they_are_needed():
    nodes = [
        node("MatMul", ["a", "x"], ["row"]),
        node("Concat", ["many", "row"], ["points"], axis=0),
        node("MatMul", ["b", "points"], ["inside"]),
        node("Gemm", ["points", "w"], ["mean"], transB=1),
    ]
    known = known_of(
        {"many": np.zeros((5, POINTS), np.float32)},
        a=(1, 3), x=(3, POINTS), row=(1, POINTS), points=(6, POINTS), b=(2, 6),
        inside=(2, POINTS), w=(1, POINTS), mean=(6, 1),
    )  # fmt: skip
    found, late = with_late_copies(nodes, known, ["inside", "mean"])
    (again,) = late
    assert [n.output[0] for n in found] == ["row", "points", again, "inside", "mean"]
    assert found[-1].input[0] == again and found[3].input[1] == "points"
    stage, *others = in_stages(found, known, ["inside", "mean"], late)
    assert names(stage) == ["row", "points", "inside"] and stage.outputs == ("row", "inside")
    assert [names(step) for step in others] == [again, "mean"]


def test_points_of_which_much_varies_are_stored():
    nodes = [
        node("MatMul", ["a", "x"], ["rows"]),
        node("Concat", ["one", "rows"], ["points"], axis=0),
        node("Gemm", ["points", "w"], ["mean"], transB=1),
    ]
    known = known_of(
        {"one": np.zeros((1, POINTS), np.float32)},
        a=(5, 3), x=(3, POINTS), rows=(5, POINTS), points=(6, POINTS), w=(1, POINTS), mean=(6, 1),
    )  # fmt: skip
    assert with_late_copies(nodes, known, ["mean"]) == (nodes, frozenset())
