"""Nodes of a graph that are computed together, as one operator of C.

Monomials, products of rows that are picked from one table, become `ProductsOfRows`, and the sums
that a Gauss-Newton step needs (`polynomial_residuals.gauss_newton`) `GaussNewtonSums`. Systems of
several scales of the model's errors (`scale_mixture`) become one: `ErrorsApart`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from training.export_c.fixed_points import with_fixed_points
from training.export_c.integrated_errors import (
    APART,
    FACTOR,
    INTEGRATION,
    MEAN,
    ROWS,
    SQUARES,
    SUMS,
    makers_of,
    only_user,
    over_rows,
    users_of,
    with_errors_integrated_out,
)
from training.export_c.solved_polynomials import with_solved_polynomials
from training.export_c.tensor import Tensor
from training.onnx_graph.builder import needed_nodes


def joined(nodes: Sequence[Any], known: dict[str, Tensor], outputs: Iterable[str]) -> list[Any]:
    """The nodes, with those that one operator of C computes as one node.

    known: Constants by name, to which new ones are added.
    outputs: Names that are needed in the end.
    """
    kept = frozenset(outputs)
    found = with_errors_integrated_out(_with_sums_of_squares(nodes, kept), known, outputs)
    found = with_fixed_points(_with_products_of_rows(found, known), known)
    found = _with_gauss_newton_sums(found, known)
    found = _with_factors(_with_errors_apart(found, known), known)
    found = with_solved_polynomials(found, known)
    return needed_nodes(_without_repeats(found, kept), list(outputs))[0]


def _with_sums_of_squares(nodes: Sequence[Any], outputs: frozenset[str]) -> list[Any]:
    """The nodes, with sums of a value times itself as one node each, which needs no product."""
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    new: dict[str, list[Any]] = {}
    for node in nodes:
        product: Any = makers.get(node.input[0]) if node.op_type == "ReduceSum" else None
        if product is None or product.op_type != "Mul" or len(set(product.input)) > 1:
            continue
        name = product.output[0]
        if name in outputs or len(users[name]) != 1:
            continue
        squares = helper.make_node(
            "ReduceSumSquare", [product.input[0], *node.input[1:]], node.output
        )
        squares.attribute.extend(node.attribute)
        new[name], new[node.output[0]] = [], [squares]
    return [made for node in nodes for made in new.get(node.output[0], [node])]


def _without_repeats(nodes: Sequence[Any], outputs: frozenset[str]) -> list[Any]:
    """The nodes, with those that compute what an earlier one has computed left out."""
    first: dict[bytes, Any] = {}
    same: dict[str, str] = {}  # names by those that stand for the same value
    result = []
    for node in nodes:
        own = type(node)()
        own.CopyFrom(node)
        own.input[:] = [same.get(name, name) for name in node.input]
        bare = type(node)()
        bare.CopyFrom(own)
        bare.ClearField("output")
        bare.ClearField("name")
        earlier = first.setdefault(bare.SerializeToString(deterministic=True), own)
        if earlier is own or len(earlier.output) != len(own.output) or outputs & {*own.output}:
            result.append(own)
        else:
            same |= dict(zip(own.output, earlier.output, strict=True))
    return result


def _with_products_of_rows(nodes: Sequence[Any], known: Mapping[str, Tensor]) -> list[Any]:
    """The nodes, with products of rows picked from one matrix as one node each."""
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    gone, new = set(), {}
    for node in nodes:
        picks: list[Any] = [makers.get(name) for name in node.input]
        if node.op_type != "Mul" or any(pick is None for pick in picks):
            continue
        left, right = picks
        if left is right or not all(_picks_rows(pick, known, users) for pick in picks):
            continue
        if left.input[0] == right.input[0]:
            inputs = [left.input[0], left.input[1], right.input[1]]
            new[id(node)] = helper.make_node(ROWS, inputs, list(node.output))
            gone |= {id(left), id(right)}
    return [new.get(id(node), node) for node in nodes if id(node) not in gone]


def _picks_rows(node: Any, known: Mapping[str, Tensor], users: Mapping[str, list[Any]]) -> bool:
    """Whether a node picks rows by constant numbers, for one other node."""
    if node.op_type != "Gather" or len(users[node.output[0]]) != 1:
        return False
    picked = known.get(node.input[1])
    axis = next((a.i for a in node.attribute if a.name == "axis"), 0)
    constant = picked is not None and picked.value is not None and picked.rank == 1
    return constant and axis == 0 and node.input[0] not in known


def _with_gauss_newton_sums(nodes: Sequence[Any], known: Mapping[str, Tensor]) -> list[Any]:
    """The nodes, with the sums that Gauss-Newton steps need as one node each.

    Its inputs: a system and the monomials of points; a system, the numbers of whose columns, times
    factors, are that of the derivatives, with the monomials of these between the two; further rows
    of both systems, where these are the same.
    """
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    gone, new = set(), {}
    for node in nodes:
        if node.op_type != "ReduceSum" or not over_rows(node, known):
            continue
        product: Any = makers.get(node.input[0])
        if product is None or product.op_type != "Mul" or len(users[product.output[0]]) != 1:
            continue
        found: list[Any] = [makers.get(name) for name in product.input]
        residual, slope = found
        squares = slope and only_user(users, slope.output[0], "ReduceSumSquare", lambda n: True)
        if not squares or not over_rows(squares, known) or len(users[slope.output[0]]) != 2:
            continue
        matrices = residual is not None and residual.op_type == slope.op_type == "MatMul"
        if not matrices or len(users[residual.output[0]]) != 1:
            continue
        derived: Any = makers.get(slope.input[0])
        picked: Any = derived and makers.get(derived.input[0])
        if not picked or (picked.op_type, derived.op_type) != ("Gather", "Mul"):
            continue
        later = residual if _place(nodes, residual) > _place(nodes, slope) else slope
        factors = known.get(derived.input[1])
        numbers = known.get(picked.input[1])
        if any(t is None or t.value is None or t.rank != 1 for t in (factors, numbers)):
            continue
        columns = [picked.input[0], slope.input[1], picked.input[1], derived.input[1]]
        inputs = [*residual.input, *columns]
        new[id(later)] = helper.make_node(SUMS, inputs, [squares.output[0], node.output[0]])
        gone |= {id(n) for n in (residual, slope, product, squares, node)}
    return [new.get(id(node), node) for node in nodes if id(node) not in gone or id(node) in new]


def _with_errors_apart(nodes: Sequence[Any], known: dict[str, Tensor]) -> list[Any]:
    """The nodes, with systems that differ in the sizes of errors as one system, and small matrices.

    Rows of system and errors are reflected so that errors are in the first rows alone: only these
    differ by scale, by a matrix of as many rows and columns as there are errors.
    """
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    found = next((n for n in nodes if n.op_type == INTEGRATION and len(n.input) == 2), None)
    if found is None:
        return list(nodes)
    sources: list[Any] = [makers.get(name) for name in found.input]
    copies, columns = sources
    reshaped = copies and makers.get(copies.input[0])
    if reshaped is None or columns is None or {copies.op_type, columns.op_type} != {"Mul"}:
        return list(nodes)
    matrix = f"{found.output[0]}_apart"
    shares = f"{found.output[0]}_shares"
    given = [reshaped.input[0], *columns.input]
    errors = next(a.i for a in found.attribute)
    made = [matrix, shares, *found.output[1:]]
    new = {id(found): [helper.make_node(APART, given, made, errors=errors)]}
    one = {found.output[0]: matrix}  # the system in place of several
    gone = {id(copies), id(reshaped), id(columns)}
    factors: dict[str, Any] = {}  # the nodes of the rows without errors, by system
    tops: dict[str, str] = {}  # the first rows, by system: the others are not needed any more
    rest_of: dict[str, str] = {}  # the same rows, by the mean of the first rows over scales
    for node in nodes:
        name = next((name for name in node.input if name in one), None)
        if name is None:
            continue
        copy = _of_one_matrix(node, one, known)
        if copy is not None:
            one[node.output[0]] = copy.output[0]
            new[id(node)] = [copy]
            continue
        (user,) = users[node.output[0]][:1]
        if one[name] not in factors:
            tops[one[name]] = f"{one[name]}_top"
            both = [f"{one[name]}_rest", tops[one[name]]]
            factors[one[name]] = helper.make_node(FACTOR, [one[name]], both, skipped=errors)
        rest, top = factors[one[name]].output[0], tops[one[name]]
        if node.op_type == "MatMul" and node.input[0] == name and _sums_squares(user, known):
            parts = [top, shares, rest, node.input[1]]
            gone.add(id(node))
            new[id(user)] = [helper.make_node(SQUARES, parts, list(user.output))]
        elif node.op_type == "Reshape":
            for product in users[node.output[0]]:
                (last,) = users[product.output[0]]
                if product.op_type != "MatMul" or last.op_type != "Reshape":
                    return list(nodes)
                parts = [top, shares, product.input[0]]
                gone.add(id(product))
                new[id(last)] = [helper.make_node(MEAN, parts, list(last.output))]
                rest_of[last.output[0]] = rest
            gone.add(id(node))
        else:
            return list(nodes)
    result = []
    for node in nodes:
        for own in new.get(id(node), [] if id(node) in gone else [node]):
            result.append(own)
            result += [factors[name] for name in own.output if name in factors]
    return _with_further_rows(result, rest_of)


def _with_further_rows(nodes: Sequence[Any], rest_of: Mapping[str, str]) -> list[Any]:
    """The nodes, with the rows without errors in the sums over the mean of the first rows."""
    result: list[Any] = []
    for node in nodes:
        if node.op_type == SUMS and node.input[0] in rest_of:
            new = type(node)()
            new.CopyFrom(node)
            new.input.append(rest_of[node.input[0]])
            node = new
        result.append(node)
    return result


def _of_one_matrix(node: Any, one: Mapping[str, str], known: dict[str, Tensor]) -> Any:
    """A node that treats rows of several systems, for the one system in their place."""
    from onnx import helper

    inputs, made = [one.get(name, name) for name in node.input], f"{node.output[0]}_apart"
    if node.op_type == "Mul" and node.input[1] not in one:
        return helper.make_node(node.op_type, inputs, [made])
    if node.op_type == "Concat" and node.input[0] in one and len(node.input) == 2:
        constant = known.get(node.input[1])
        if (
            constant is None
            or constant.value is None
            or (constant.value != constant.value[0]).any()
        ):
            return None
        first = f"{node.input[1]}_first"
        known[first] = Tensor.constant(constant.value[0], first)
        return helper.make_node("Concat", [inputs[0], first], [made], axis=0)
    return None


def _sums_squares(node: Any, known: Mapping[str, Tensor]) -> bool:
    """Whether a node sums squares over the rows of several products."""
    axes = known.get(node.input[1]) if node.op_type == "ReduceSumSquare" else None
    return axes is not None and axes.value is not None and axes.value.tolist() == [1]


def _with_factors(nodes: Sequence[Any], known: Mapping[str, Tensor]) -> list[Any]:
    """The nodes, with systems of which only sums of squares are needed replaced by fewer rows."""
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    changed: dict[int, tuple[int, ...]] = {}  # inputs of nodes that are replaced
    wanted: set[str] = set()  # systems with fewer rows
    for node in nodes:
        if not node.input or node.input[0] not in makers:
            continue
        if node.op_type == SUMS and len(node.input) == 6 and node.input[0] == node.input[2]:
            changed[id(node)] = (0, 2)
        elif node.op_type == "MatMul" and node.input[0] not in known:
            (*others, user) = users[node.output[0]]
            if not others and user.op_type == "ReduceSumSquare" and over_rows(user, known):
                changed[id(node)] = (0,)
        if id(node) in changed:
            wanted.add(node.input[0])
    result = []
    for node in nodes:
        new = node
        if id(node) in changed:
            new = type(node)()
            new.CopyFrom(node)
            for place in changed[id(node)]:
                new.input[place] = f"{node.input[place]}_factor"
        result.append(new)
        for name in wanted.intersection(node.output):
            result.append(helper.make_node(FACTOR, [name], [f"{name}_factor"], skipped=0))
    return result


def _place(nodes: Sequence[Any], node: Any) -> int:
    return next(k for k, other in enumerate(nodes) if other is node)
