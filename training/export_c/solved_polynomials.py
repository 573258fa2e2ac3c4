r"""Residuals as polynomials of the solved coordinate, whose coefficients are computed once a point.

Points of a round differ from those of its Gauss-Newton steps in their last coordinate t alone. The
residuals of a point are

.. math:: r(t) = \sum_g c_g t^g, \qquad c_g = \sum_{i \in g} A_i b_i

with A_i the columns of the system and b_i the monomials of the other coordinates, by their power g
of t. So a step and the weights of its points need one product with the system together.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.export_c.fixed_points import FixedMonomials, FixedPoints
from training.export_c.integrated_errors import (
    ROWS,
    SQUARES,
    SUMS,
    makers_of,
    over_rows,
    users_of,
)
from training.export_c.tensor import Tensor

COEFFICIENTS, STEP_SUMS = "SolvedCoefficients", "SolvedSums"
SOLVED_SQUARES, SOLVED_SCALES = "SolvedSquares", "SolvedSquaresByScale"


@dataclass(frozen=True)
class _Monomials:
    """Monomials of the other coordinates, in the order of their power of the solved one.

    name: Of the monomials (terms, n).
    solved: Name of the solved coordinate (1, n).
    powers: Of the solved coordinate, by column of the system.
    nodes: That compute them; none where they are constant.
    """

    name: str
    solved: str
    powers: NDArray[np.intp]
    nodes: tuple[Any, ...]

    def coefficients(self, system: str, known: dict[str, Tensor]) -> tuple[Any, Any]:
        """Nodes of a system (m, terms) by power, and of its coefficients (m * powers, n)."""
        from onnx import helper

        order = _by_power(self.powers)
        columns = f"by_power_{zlib.crc32(order.tobytes()):08x}"
        known[columns] = Tensor.constant(order, columns)
        ordered, made = f"{system}_{columns}", f"{system}_{self.name}"
        ends = np.searchsorted(self.powers[order], np.arange(self.powers.max() + 1), "right")
        return (
            helper.make_node("Gather", [system, columns], [ordered], axis=1),
            helper.make_node(COEFFICIENTS, [ordered, self.name], [made], ends=ends.tolist()),
        )


def _by_power(powers: NDArray[np.intp]) -> NDArray[np.int32]:
    return np.argsort(powers, kind="stable").astype(np.int32)


def with_solved_polynomials(nodes: Sequence[Any], known: dict[str, Tensor]) -> list[Any]:
    """The nodes, with products of systems and monomials by powers of the solved coordinate."""
    from onnx import helper

    users, makers = users_of(nodes), makers_of(nodes)
    points = FixedPoints(nodes, known)
    new: dict[int, list[Any]] = {}
    for node in nodes:
        place = {SUMS: 1, SQUARES: 3, "MatMul": 1}.get(node.op_type)
        if place is None or node.input[place] in known:
            continue
        found = _monomials(node.input[place], makers, known)
        found = found or _of_fixed_points(points.monomials(node.input[place]), known)
        if found is None:
            continue
        groups = int(found.powers.max()) + 1
        if node.op_type == SUMS:
            if not _is_derivative(node, found.powers, known):
                continue
            systems = [node.input[0], *node.input[6:]]
            parts = [found.coefficients(system, known) for system in systems]
            inputs = [found.solved, *(part.output[0] for _, part in parts)]
            last = helper.make_node(STEP_SUMS, inputs, list(node.output), groups=groups)
        elif node.op_type == SQUARES:
            top, matrices, rest, _ = node.input
            parts = [found.coefficients(system, known) for system in (top, rest)]
            first, others = (part.output[0] for _, part in parts)
            inputs = [found.solved, first, matrices, others]
            last = helper.make_node(SOLVED_SCALES, inputs, list(node.output), groups=groups)
        else:
            (*more, user) = users.get(node.output[0], [None])
            if more or user is None or user.op_type != "ReduceSumSquare":
                continue
            if not over_rows(user, known):
                continue
            parts = [found.coefficients(node.input[0], known)]
            inputs = [found.solved, parts[0][1].output[0]]
            last = helper.make_node(SOLVED_SQUARES, inputs, list(user.output), groups=groups)
            new[id(user)] = []
        new[id(node)] = [*found.nodes, *(own for both in parts for own in both), last]
    made: set[str] = set()
    result = []
    for node in nodes:
        for own in new.get(id(node), [node]):
            if own.output[0] not in made:
                result.append(own)
            made |= {*own.output}
    return result


def _monomials(name: str, makers: Mapping[str, Any], known: dict[str, Tensor]) -> _Monomials | None:
    """Of products of products of coordinates, of which the last is solved for."""
    from onnx import helper

    chain: list[Any] = []
    for kind in (ROWS, ROWS, "Concat"):
        node = makers.get(chain[-1].input[0] if chain else name)
        if node is None or node.op_type != kind:
            return None
        chain.append(node)
    second, first, points = chain
    if len(points.input) < 2:
        return None
    head = known.get(points.input[0])
    if head is None or head.value is None or head.rank != 2:
        return None
    pairs, terms = (_numbers(node, known) for node in (first, second))
    if pairs is None or terms is None:
        return None
    powers = (pairs == pairs.max()).sum(axis=0)[terms].sum(axis=0)
    order = _by_power(powers)
    stem = "_".join(points.input[:-1])
    ones, by_power = f"{stem}_ones", f"{second.input[1]}_{second.input[2]}_by_power"
    known[ones] = Tensor.constant(np.ones((1, head.value.shape[1]), head.value.dtype), ones)
    for k, side in enumerate(("left", "right")):
        known[f"{by_power}_{side}"] = Tensor.constant(terms[k][order], f"{by_power}_{side}")
    made = [f"{stem}_{part}" for part in ("others", "pairs", by_power)]
    nodes = (
        helper.make_node("Concat", [*points.input[:-1], ones], [made[0]], axis=0),
        helper.make_node(ROWS, [made[0], *first.input[1:]], [made[1]]),
        helper.make_node(ROWS, [made[1], f"{by_power}_left", f"{by_power}_right"], [made[2]]),
    )
    return _Monomials(made[2], points.input[-1], powers, nodes)


def _of_fixed_points(found: FixedMonomials | None, known: dict[str, Tensor]) -> _Monomials | None:
    """Of points whose other coordinates are constant."""
    if found is None or not found.solved or len(found.values) < 2:
        return None
    values = np.ascontiguousarray(found.values[_by_power(found.powers)])
    name = f"monomials_{zlib.crc32(values.tobytes()):08x}"
    known[name] = Tensor.constant(values, name)
    return _Monomials(name, found.solved, found.powers, ())


def _numbers(node: Any, known: Mapping[str, Tensor]) -> NDArray[np.intp] | None:
    """Numbers of the rows whose products a node forms, (2, products)."""
    found = [known[name].value for name in node.input[1:] if name in known]
    return None if len(found) < 2 else np.asarray(found, np.intp)


def _is_derivative(node: Any, powers: NDArray[np.intp], known: Mapping[str, Tensor]) -> bool:
    """Whether the factors of a Gauss-Newton step are powers of the solved coordinate."""
    picked, factors = (known[name].value for name in node.input[4:6])
    if node.input[0] != node.input[2] or picked is None or factors is None:
        return False
    found = np.zeros(len(powers))
    found[picked] = factors
    return np.array_equal(found, powers)
