"""Parts of a graph that treat points one by one, so that a few at a time can be computed.

A point is an index along the last axis. Operators that compute each of them by itself, products of
matrices with a column for each point among them, are joined to stages. A stage takes `TILE` points
at a time: what is between its inputs and its outputs then needs memory for these alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from training.export_c.integrated_errors import ROWS, SQUARES, SUMS, users_of
from training.export_c.operators.elementwise import OPERATORS as ELEMENTWISE
from training.export_c.operators.reductions import REDUCTIONS
from training.export_c.solved_polynomials import (
    COEFFICIENTS,
    SOLVED_SCALES,
    SOLVED_SQUARES,
    STEP_SUMS,
)
from training.export_c.tensor import Size, Tensor

#: Points that a stage takes at a time; the latter where memory is scarce.
TILE, SMALL_TILE = 32, 8
LEAST_POINTS = 128  # Fewer are not worth a stage
#: Operators that move elements along an axis.
MOVING = ("Concat", "Gather", "Slice", "Split")
POLYNOMIALS = (COEFFICIENTS, SOLVED_SCALES, SOLVED_SQUARES, STEP_SUMS)
PRODUCTS = ("Gemm", "MatMul", SQUARES, SUMS, *POLYNOMIALS)
#: Results of so many numbers a point, which another stage needs, are stored; wider ones are
#: computed again there, if they follow from others without products or functions.
STORED = 8
#: Of the numbers that `with_late_copies` computes again, one in so many varies at most.
LEAST_CONSTANT = 4
#: The input that has the points, if it is not the first.
_POINTS_AT = {"Gemm": 1, "MatMul": 1, SUMS: 1, SQUARES: 3, COEFFICIENTS: 1}
RECOMPUTED = (*MOVING, ROWS, "Add", "Identity", "Mul", "Sub")


@dataclass(frozen=True)
class PointStage:
    """Nodes that treat points one by one.

    nodes: In their order.
    points: Number of points.
    tiled: Values made elsewhere, or constants, of which each point has its own elements.
    outputs: Values that are needed elsewhere.
    """

    nodes: tuple[Any, ...]
    points: int
    tiled: tuple[str, ...]
    outputs: tuple[str, ...]


def with_late_copies(
    nodes: Sequence[Any], known: dict[str, Tensor], outputs: Iterable[str]
) -> tuple[list[Any], frozenset[str]]:
    """Nodes, and the results among theirs that are computed where they are needed, if need be anew.

    Those are constants joined to a few rows of points: large, and no more work than a copy. A stage
    that needs the same has it from a node of its own.

    nodes: All nodes, in an order in which they can be computed.
    known: The value of each name that a node reads or makes; those of new nodes are added.
    outputs: Names that are needed in the end.
    """
    groups = _groups(nodes, known)
    treats = {id(nodes[i]): own for (_, own), group in groups.items() for i in group}
    users, late = users_of(nodes), set[str]()
    renamed: dict[int, dict[str, str]] = {}  # inputs of nodes that read a copy
    copied: list[Any] = []
    for node in nodes:
        copied.append(node)
        name = node.output[0]
        if name in outputs or not _is_mostly_constant(node, known):
            continue
        others = [user for user in users[name] if not treats[id(user)]]
        again = name
        if others and len(others) < len(users[name]):
            again = f"{name}_again"
            copied.append(_with_names(node, {}, again))
            known[again] = known[name]
            for user in others:
                renamed.setdefault(id(user), {})[name] = again
        if others:
            late.add(again)
    return [_with_names(node, renamed.get(id(node), {})) for node in copied], frozenset(late)


def _with_names(node: Any, names: Mapping[str, str], output: str = "") -> Any:
    """A node with other names of inputs, and of its output; itself where nothing changes."""
    if not names and not output:
        return node
    new = type(node)()
    new.CopyFrom(node)
    new.input[:] = [names.get(name, name) for name in node.input]
    if output:
        new.output[:] = [output]
    return new


def _is_mostly_constant(node: Any, known: Mapping[str, Tensor]) -> bool:
    """Whether a node joins constants to a few rows of points."""
    whole = known.get(node.output[0])
    if node.op_type != "Concat" or whole is None or not whole.count.fixed:
        return False
    varying = [known[name].count for name in node.input if known[name].value is None]
    few = sum(count.constant for count in varying) * LEAST_CONSTANT <= whole.count.constant
    return whole.rank > 1 and whole.shape[-1].constant >= LEAST_POINTS and bool(varying) and few


def _groups(
    nodes: Sequence[Any], known: Mapping[str, Tensor], late: frozenset[str] = frozenset()
) -> dict[tuple[int, int], list[int]]:
    """Numbers of nodes by their level, and by the number of points that they treat one by one."""
    points = [0 if node.output[0] in late else _points(node, known) for node in nodes]
    while True:
        levels = _levels(nodes, points, known)
        groups: dict[tuple[int, int], list[int]] = {}
        for index, (level, own) in enumerate(zip(levels, points, strict=True)):
            groups.setdefault((level, own), []).append(index)
        slight = [
            index
            for (_, many), members in groups.items()
            if many and not any(nodes[i].op_type in PRODUCTS for i in members)
            for index in members
        ]
        if not slight:
            return groups
        for index in slight:
            points[index] = 0


def in_stages(
    nodes: Sequence[Any],
    known: Mapping[str, Tensor],
    outputs: Iterable[str],
    late: frozenset[str] = frozenset(),
) -> list[Any]:
    """Nodes in an order in which those that treat the same points stand together, as stages.

    nodes: All nodes, in an order in which they can be computed.
    known: The value of each name that a node reads or makes, with its shape.
    outputs: Names that are needed in the end.
    late: Results that are computed outside of stages (`with_late_copies`).
    """
    groups = _groups(nodes, known, late)
    wanted = set(outputs)
    whole = {(k, n): [nodes[i] for i in group] for (k, n), group in groups.items()}
    stages = {key: _with_recomputed(whole[key], key[1], nodes, known) for key in whole if key[1]}
    read = {
        key: {name for node in stages.get(key, group) for name in node.input}
        for key, group in whole.items()
    }
    ordered: list[Any] = []
    for key in sorted(whole):
        if not key[1]:
            ordered += whole[key]
            continue
        members = stages[key]
        made = {name for node in whole[key] for name in node.output}
        inside = {name for node in members for name in node.output}
        elsewhere = set().union(wanted, *(names for other, names in read.items() if other != key))
        made_there = [
            {name for node in stages[other] for name in node.output}
            for other in stages
            if other != key and read[other] & made
        ]
        again = set.intersection(*made_there) if made_there else set()
        plain = set().union(wanted, *(names for other, names in read.items() if not other[1]))
        outside = [name for node in members for name in node.input if name not in inside]
        ordered.append(
            PointStage(
                nodes=tuple(members),
                points=key[1],
                tiled=tuple(
                    dict.fromkeys(n for n in outside if _is_tiled(n, members, key[1], known))
                ),
                outputs=tuple(
                    name
                    for node in whole[key]
                    for name in node.output
                    if name in plain or (name in elsewhere and name not in again)
                ),
            )
        )
    return ordered


def _with_recomputed(
    members: list[Any], points: int, nodes: Sequence[Any], known: Mapping[str, Tensor]
) -> list[Any]:
    """The nodes of a stage, with those of earlier stages whose wide results it computes again."""
    makers = {name: node for node in nodes for name in node.output}
    chosen = {id(node) for node in members}
    open_nodes = list(members)
    while open_nodes:
        node = open_nodes.pop()
        for place, name in enumerate(node.input):
            maker = makers.get(name)
            if maker is None or id(maker) in chosen or known[name].value is not None:
                continue
            if not (_aligned(node, place, points, known) and _points(maker, known) == points):
                continue
            shape = known[name].shape
            wide = (
                len(shape) > 1 and shape[-2].most({}) > STORED
                if shape[-2:-1] and shape[-2].fixed
                else True
            )
            if wide and maker.op_type in RECOMPUTED:
                chosen.add(id(maker))
                open_nodes.append(maker)
    return [node for node in nodes if id(node) in chosen]


def _levels(nodes: Sequence[Any], points: Sequence[int], known: Mapping[str, Tensor]) -> list[int]:
    """Of each node, how many times all points must have been computed before."""
    made: dict[str, tuple[int, int]] = {}
    levels = []
    for node, own in zip(nodes, points, strict=True):
        level = 0
        for place, name in enumerate(node.input):
            if name not in made:
                continue
            before, of_points = made[name]
            together = own and of_points == own and _aligned(node, place, own, known)
            level = max(level, before + (1 if of_points and not together else 0))
        levels.append(level)
        made |= dict.fromkeys(node.output, (level, own))
    return levels


def _points(node: Any, known: Mapping[str, Tensor]) -> int:
    """The number of points that a node treats one by one; zero if it does not."""
    inputs = [known.get(name) for name in node.input]
    if any(tensor is None and name for tensor, name in zip(inputs, node.input, strict=True)):
        return 0
    outputs = [known[name] for name in node.output if name in known]
    if any(tensor.value is not None or tensor.sizes is not None for tensor in outputs):
        return 0
    if not _treats_points(node, known):
        return 0
    last = known[node.input[_POINTS_AT.get(node.op_type, 0)]].shape[-1:]
    sizes = {t.shape[-1] for t in outputs if t.shape} or set(last)
    if len(sizes) != 1:
        return 0
    (size,) = sizes
    if not size.fixed or size.constant < LEAST_POINTS or size.constant % TILE:
        return 0
    many = size.constant
    for place, tensor in enumerate(inputs):
        fits = tensor is None or tensor.shape[-1:] in ((), (Size(1),)) or tensor.shape[-1] == size
        if not (fits or not _may_be_aligned(node, place)):
            return 0
    return many


def _treats_points(node: Any, known: Mapping[str, Tensor]) -> bool:
    """Whether the elements of its outputs follow from those at the same place of the last axis."""
    attributes = {a.name: a for a in node.attribute}
    if node.op_type in ELEMENTWISE or node.op_type in (
        "Identity",
        ROWS,
        SQUARES,
        SUMS,
        *POLYNOMIALS,
    ):
        return True
    if node.op_type == "MatMul":
        return all(known[name].rank >= 2 for name in node.input)
    if node.op_type == "Gemm":
        return not ("transB" in attributes and attributes["transB"].i)
    rank = known[node.input[0]].rank
    if node.op_type in MOVING[:2] or node.op_type == "Split":
        axis = attributes["axis"].i if "axis" in attributes else 0
        constant = node.op_type != "Gather" or known[node.input[1]].value is not None
        return constant and rank > 1 and axis % rank != rank - 1
    if node.op_type in REDUCTIONS and len(node.input) > 1:
        value = known[node.input[1]].value
        return (
            value is not None and value.size > 0 and all(a % rank != rank - 1 for a in value.flat)
        )
    return False


def _may_be_aligned(node: Any, place: int) -> bool:
    """Whether an input of a node may have an element for each point."""
    if node.op_type in (SQUARES, SUMS):
        return place == 3 or (place == 1 and node.op_type == SUMS)
    if node.op_type == COEFFICIENTS:
        return place == 1
    if node.op_type in POLYNOMIALS:  # matrices of scales have none
        return node.op_type != SOLVED_SCALES or place != 2
    if node.op_type in PRODUCTS:
        return place > 0
    return place == 0 or node.op_type in ELEMENTWISE or node.op_type == "Concat"


def _aligned(node: Any, place: int, points: int, known: Mapping[str, Tensor]) -> bool:
    """Whether an input of a node that treats points has an element for each of them."""
    return _may_be_aligned(node, place) and known[node.input[place]].shape[-1:] == (Size(points),)


def _is_tiled(name: str, members: Sequence[Any], points: int, known: Mapping[str, Tensor]) -> bool:
    return any(
        other == name and _aligned(node, place, points, known)
        for node in members
        for place, other in enumerate(node.input)
    )
