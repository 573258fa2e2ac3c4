"""Nodes of a graph that integrate errors out of linear systems, recognised as one operator.

The graph of a set posterior has some ten nodes for each error that all readings share
(`training.set_posterior.sensor_errors.integrate_out_errors`, and `scale_mixture` for several scales
at once). They become one node `IntegrateOut`: in C a loop over errors that changes the system in
its place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from training.export_c.tensor import Tensor

INTEGRATION = "IntegrateOut"
#: Other operators that stand for several nodes.
ROWS, SUMS = "ProductsOfRows", "GaussNewtonSums"
APART, FACTOR, MEAN = "ErrorsApart", "RowFactor", "MeanOfScales"
SQUARES = "SquaresByScale"


@dataclass(frozen=True)
class _Step:
    """The nodes that integrate out the error of the last column of a system."""

    nodes: tuple[Any, ...]
    result: str  # name of the system without it
    determinant: str  # name of its determinant; empty where that is not needed


def users_of(nodes: Sequence[Any]) -> dict[str, list[Any]]:
    """The nodes that read each value."""
    users: dict[str, list[Any]] = {}
    for node in nodes:
        for name in node.input:
            users.setdefault(name, []).append(node)
    return users


def makers_of(nodes: Sequence[Any]) -> dict[str, Any]:
    """The node that makes each value."""
    return {name: node for node in nodes for name in node.output}


def with_errors_integrated_out(
    nodes: Sequence[Any], known: Mapping[str, Tensor], outputs: Iterable[str]
) -> list[Any]:
    """The nodes, with those that integrate out errors one after another as one node."""
    from onnx import helper

    users = users_of(nodes)
    uses = Counter({name: len(found) for name, found in users.items()})
    uses.update(outputs)
    makers = makers_of(nodes)
    replaced: dict[int, Any] = {}  # the new node, by the place of the first one that it replaces
    gone: set[int] = set()
    for node in nodes:
        if id(node) in gone or node.op_type != "Split":
            continue
        steps, passed, split = [], [], node
        while (step := _step(split, users, known)) is not None:
            steps.append(step)
            name, between = step.result, []
            while uses[name] == 1 and name in users and users[name][0].op_type == "Identity":
                between.append(users[name][0])
                name = between[-1].output[0]
            if uses[name] != 1 or name not in users or users[name][0].op_type != "Split":
                break
            following = users[name][0]
            if _step(following, users, known) is None:
                break
            passed += between
            split = following
        if not steps:
            continue
        joined = makers.get(node.input[0])
        inputs = [node.input[0]]
        if joined is not None and _joins_columns(joined, node) and uses[node.input[0]] == 1:
            inputs, passed = list(joined.input), [*passed, joined]
        determinants = [step.determinant for step in steps]
        made = [steps[-1].result, *determinants]
        new = helper.make_node(INTEGRATION, inputs, made, errors=len(steps))
        replaced[id(node)] = new
        gone |= {id(old) for step in steps for old in step.nodes} | {id(old) for old in passed}
    kept = []
    for node in nodes:
        if id(node) in replaced:
            kept.append(replaced[id(node)])
        elif id(node) not in gone:
            kept.append(node)
    return kept


def _joins_columns(node: Any, split: Any) -> bool:
    """Whether a node joins the columns of systems of several scales, which a split takes apart."""
    axes = [next((a.i for a in n.attribute if a.name == "axis"), 0) for n in (node, split)]
    return node.op_type == "Concat" and axes == [2, 2]


def _step(split: Any, users: Mapping[str, list[Any]], known: Mapping[str, Tensor]) -> _Step | None:
    """The nodes that integrate out the last column, which a node splits off; None for others."""
    if len(split.output) != 2 or len(split.input) != 2 or split.input[1] not in known:
        return None
    if known[split.input[1]].numbers("a length")[-1] != 1:
        return None
    axis = next((a.i for a in split.attribute if a.name == "axis"), 0)
    return (_of_one_system if axis == 1 else _of_several_systems)(split, users, known)


def _of_one_system(
    split: Any, users: Mapping[str, list[Any]], known: Mapping[str, Tensor]
) -> _Step | None:
    r"""d = 1 + g^T g; A - g / (d + \sqrt d) (g^T A), as products of matrices."""
    a, g = split.output
    determinant = only_user(users, g, "Gemm", lambda n: list(n.input[:2]) == [g, g])
    change = only_user(users, g, "Gemm", lambda n: list(n.input) == [g, a])
    scaled = only_user(users, g, "Div", lambda n: n.input[0] == g)
    if determinant is None or change is None or scaled is None or len(determinant.input) < 3:
        return None
    root = only_user(users, determinant.output[0], "Sqrt", lambda n: True)
    kappa = root and only_user(
        users, root.output[0], "Add", lambda n: n.output[0] == scaled.input[1]
    )
    result = only_user(
        users, scaled.output[0], "Gemm", lambda n: list(n.input[1:]) == [change.output[0], a]
    )
    if kappa is None or result is None or not _is_one(known, determinant.input[2]):
        return None
    nodes = (split, determinant, change, scaled, root, kappa, result)
    complete = {g: 4, a: 2, determinant.output[0]: 2, change.output[0]: 1, scaled.output[0]: 1}
    if any(len(users[name]) != count for name, count in complete.items()):
        return None
    return _Step(nodes, result.output[0], "")


def _of_several_systems(
    split: Any, users: Mapping[str, list[Any]], known: Mapping[str, Tensor]
) -> _Step | None:
    """The same, of systems (scales, m, columns) at once."""
    a, g = split.output
    squares = only_user(users, g, "ReduceSumSquare", lambda n: True)
    turned = only_user(users, g, "Transpose", lambda n: True)
    scaled = only_user(users, g, "Div", lambda n: n.input[0] == g)
    if squares is None or turned is None or scaled is None:
        return None
    determinant = only_user(users, squares.output[0], "Add", lambda n: _is_one(known, n.input[1]))
    change = only_user(users, turned.output[0], "MatMul", lambda n: n.input[1] == a)
    if determinant is None or change is None:
        return None
    root = only_user(users, determinant.output[0], "Sqrt", lambda n: True)
    kappa = root and only_user(
        users, root.output[0], "Add", lambda n: n.output[0] == scaled.input[1]
    )
    product = only_user(users, scaled.output[0], "Mul", lambda n: n.input[1] == change.output[0])
    if kappa is None or product is None:
        return None
    result = only_user(users, product.output[0], "Sub", lambda n: n.input[0] == a)
    if result is None or len(users[g]) != 3 or len(users[a]) != 2:
        return None
    nodes = (split, squares, turned, scaled, determinant, change, root, kappa, product, result)
    return _Step(nodes, result.output[0], determinant.output[0])


def only_user(users: Mapping[str, list[Any]], name: str, kind: str, fits: Any) -> Any:
    """The node of a kind that reads a value and fits, if there is one."""
    found = {id(n): n for n in users.get(name, ()) if n.op_type == kind and fits(n)}
    return next(iter(found.values())) if len(found) == 1 else None


def _is_one(known: Mapping[str, Tensor], name: str) -> bool:
    value = known[name].value if name in known else None
    return value is not None and bool(np.all(value == 1.0))


def over_rows(node: Any, known: Mapping[str, Tensor]) -> bool:
    """Whether a node sums over the first axis, which it keeps."""
    axes = known[node.input[1]].value if len(node.input) > 1 and node.input[1] in known else None
    kept = all(a.i for a in node.attribute if a.name == "keepdims")
    return axes is not None and axes.tolist() == [0] and kept
