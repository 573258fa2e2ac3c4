r"""Residuals at points whose coordinates but the solved one are constant, recognised in a graph.

The graph adds up products of parts of a system with monomials, by the power of the solved
coordinate (`polynomial_residuals.ResidualsAtFixedPoints`). C computes such residuals as those of
other points: from one system and its monomials, whose other coordinates are constant here.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.export_c.integrated_errors import SUMS, makers_of, only_user, over_rows, users_of
from training.export_c.tensor import Tensor

#: Monomials (terms, n) of a solved coordinate, by those of the others and its powers.
FIXED = "MonomialsAtFixedPoints"


@dataclass(frozen=True)
class FixedMonomials:
    """Rows of numbers, each times a power of one unknown number a point.

    values: Of the other coordinates, (rows, n).
    powers: Of the solved coordinate, (rows,).
    solved: Its name; empty where no power is above zero.
    """

    values: NDArray[Any]
    powers: NDArray[np.intp]
    solved: str

    def take(self, rows: NDArray[Any]) -> FixedMonomials:
        """Some of the rows."""
        return replace(self, values=self.values[rows], powers=self.powers[rows])

    def times(self, other: FixedMonomials) -> FixedMonomials:
        """The products of rows with those of another, or with its only one."""
        values, powers = self.values * other.values, self.powers + other.powers
        return FixedMonomials(values, powers, self.solved or other.solved)


@dataclass(frozen=True)
class _Residuals:
    """The product of some columns of a system, times factors, with monomials."""

    system: str
    columns: NDArray[np.intp]
    factors: NDArray[Any]
    monomials: FixedMonomials

    def plus(self, other: _Residuals) -> _Residuals:
        """The sum with the product of other columns."""
        joined = _joined((self.monomials, other.monomials))
        columns = np.concatenate([self.columns, other.columns])
        return _Residuals(
            self.system, columns, np.concatenate([self.factors, other.factors]), joined
        )

    def in_order(self) -> _Residuals:
        """The same with ascending columns."""
        order = np.argsort(self.columns)
        return _Residuals(
            self.system, self.columns[order], self.factors[order], self.monomials.take(order)
        )

    def whole(self) -> bool:
        """Whether each column of the system takes part as it is."""
        return np.array_equal(self.columns, np.arange(len(self.columns))) and bool(
            (self.factors == 1.0).all()
        )

    def has_derivative(self, slope: _Residuals) -> bool:
        """Whether these are the derivatives by the solved coordinate."""
        powers = self.monomials.powers
        rows = np.flatnonzero(powers)
        return (
            self.system == slope.system
            and np.array_equal(rows, slope.columns)
            and np.array_equal(powers[rows], slope.factors)
            and np.array_equal(powers[rows] - 1, slope.monomials.powers)
            and np.array_equal(self.monomials.values[rows], slope.monomials.values)
        )

    def at_zero(self, constant: _Residuals, slope: _Residuals) -> bool:
        """Whether others are these, and their derivatives, at zero."""
        powers, found = self.monomials.powers, (constant, slope)
        return all(
            part.system == self.system
            and np.array_equal(part.columns, np.flatnonzero(powers == power))
            and bool((part.factors == 1.0).all())
            and not part.monomials.powers.any()
            and np.array_equal(part.monomials.values, self.monomials.values[powers == power])
            for power, part in enumerate(found)
        )


def _joined(parts: Sequence[FixedMonomials]) -> FixedMonomials:
    """All rows of several, one after another."""
    count = max(part.values.shape[1] for part in parts)
    values = [np.broadcast_to(part.values, (len(part.values), count)) for part in parts]
    solved = next((part.solved for part in parts if part.solved), "")
    powers = np.concatenate([part.powers for part in parts])
    return FixedMonomials(np.concatenate(values), powers, solved)


class FixedPoints:
    """What values of a graph are in terms of constant monomials and one solved coordinate."""

    def __init__(self, nodes: Sequence[Any], known: Mapping[str, Tensor]) -> None:
        self.makers, self.known = makers_of(nodes), known

    def monomials(self, name: str) -> FixedMonomials | None:
        """A value as monomials; None for one of another kind."""
        value = self._value(name)
        if value is not None:
            floats = value.ndim == 2 and value.dtype.kind == "f"
            return FixedMonomials(value, np.zeros(len(value), np.intp), "") if floats else None
        node: Any = self.makers.get(name)
        kind = "" if node is None else node.op_type
        if kind == FIXED:
            values, powers = (self._value(given) for given in node.input[1:])
            if values is None or powers is None:
                return None
            return FixedMonomials(values, powers.astype(np.intp), node.input[0])
        if kind == "Gather":
            table, rows = self.monomials(node.input[0]), self._value(node.input[1])
            known = table is not None and rows is not None and _axis(node) == 0
            return table.take(rows) if known and table is not None and rows is not None else None
        if kind in ("Mul", "Concat"):
            parts = [self.monomials(given) for given in node.input]
            found = [part for part in parts if part is not None]
            unknowns = {part.solved for part in found if part.solved}
            if len(found) < len(parts) or len(unknowns) > 1:
                return None
            if kind == "Concat":
                return _joined(found) if _axis(node) == 0 else None
            left, right = found
            few, many = sorted(found, key=lambda part: len(part.values))
            if len(few.values) not in (1, len(many.values)):
                return None
            return left.times(right)
        if kind in ("", "Clip"):  # coordinates are limited to their range
            return FixedMonomials(np.ones((1, 1), np.float32), np.ones(1, np.intp), name)
        return None

    def residuals(self, name: str) -> _Residuals | None:
        """A value as the product of a system and monomials; None for one of another kind."""
        node: Any = self.makers.get(name)
        kind = "" if node is None else node.op_type
        if kind in ("Gemm", "MatMul") and not node.attribute:
            columns, rows = self._columns(node.input[0]), self.monomials(node.input[1])
            if columns is None or rows is None or len(columns.columns) != len(rows.values):
                return None
            product = replace(columns, monomials=rows)
            others = [self.residuals(given) for given in node.input[2:]]
        elif kind == "Add":
            first, *others = (self.residuals(given) for given in node.input)
            if first is None:
                return None
            product = first
        elif kind == "Mul":
            first, row = self.residuals(node.input[0]), self.monomials(node.input[1])
            if first is None or row is None or len(row.values) > 1:
                return None
            return replace(first, monomials=first.monomials.times(row))
        else:
            return None
        for other in others:
            if other is None or other.system != product.system:
                return None
            product = product.plus(other)
        solved = {name for name in (product.monomials.solved,) if name}
        return product.in_order() if len(solved) < 2 else None

    def _columns(self, name: str) -> _Residuals | None:
        """Columns of a system, by their numbers and factors; its monomials are not told yet."""
        node: Any = self.makers.get(name)
        kind = "" if node is None else node.op_type
        if kind == "Mul":
            found, factors = self._columns(node.input[0]), self._value(node.input[1])
            if found is None or factors is None or factors.shape != found.factors.shape:
                return None
            return replace(found, factors=found.factors * factors)
        if kind == "Gather" and _axis(node) == 1:
            numbers = self._value(node.input[1])
            if numbers is None or numbers.ndim != 1:
                return None
            none = FixedMonomials(np.zeros((0, 1)), np.zeros(0, np.intp), "")
            return _Residuals(
                node.input[0], numbers.astype(np.intp), np.ones(len(numbers), np.float32), none
            )
        if kind == "Split" and _axis(node) == 1 and len(node.input) > 1:
            whole, sizes = self._columns(node.input[0]), self._value(node.input[1])
            if whole is None or sizes is None:
                return None
            place = list(node.output).index(name)
            own = slice(int(sizes[:place].sum()), int(sizes[: place + 1].sum()))
            return replace(whole, columns=whole.columns[own], factors=whole.factors[own])
        return None

    def _value(self, name: str) -> NDArray[Any] | None:
        found = self.known.get(name)
        return None if found is None else found.value


def _axis(node: Any) -> int:
    return next((int(a.i) for a in node.attribute if a.name == "axis"), 0)


def with_fixed_points(nodes: Sequence[Any], known: dict[str, Tensor]) -> list[Any]:
    """The nodes, with sums over residuals at such points as those of any other points.

    known: Constants by name, to which new ones are added.
    """
    from onnx import helper

    points, users, makers = FixedPoints(nodes, known), users_of(nodes), makers_of(nodes)
    new: dict[int, list[Any]] = {}
    whole: dict[str, _Residuals] = {}  # residuals with all columns, by system
    pairs: list[tuple[Any, Any, _Residuals, _Residuals]] = []
    for node in nodes:
        if node.op_type == "ReduceSumSquare" and over_rows(node, known):
            found = points.residuals(node.input[0])
            if found is not None and found.whole():
                whole[found.system] = found
                product = f"{node.output[0]}_residuals"
                made = [_basis(found, known), _product(found, product)]
                squares = helper.make_node(
                    "ReduceSumSquare", [product, node.input[1]], node.output, keepdims=1
                )
                new[id(node)] = [*made, squares]
        elif node.op_type == "ReduceSum" and over_rows(node, known):
            factors: Any = makers.get(node.input[0])
            if factors is None or factors.op_type != "Mul":
                continue
            residual, slope = (points.residuals(name) for name in factors.input)
            last = only_user(users, factors.input[1], "ReduceSumSquare", lambda n: True)
            if residual is not None and slope is not None and last is not None:
                pairs.append((node, last, residual, slope))
    for node, squares, residual, slope in pairs:
        of_system = whole.get(residual.system)
        if of_system is None:
            continue
        if residual.whole() and residual.has_derivative(slope):
            own = residual
        elif of_system.at_zero(residual, slope):
            own = replace(of_system, monomials=replace(of_system.monomials, solved=""))
        else:
            continue
        basis, powers = _basis(own, known), own.monomials.powers
        picked, factors_name = f"{basis.output[0]}_picked", f"{basis.output[0]}_factors"
        rows = np.flatnonzero(powers)
        known[picked] = Tensor.constant(rows.astype(np.int64), picked)
        known[factors_name] = Tensor.constant(powers[rows].astype(np.float32), factors_name)
        name = basis.output[0]
        inputs = [own.system, name, own.system, name, picked, factors_name]
        made = helper.make_node(SUMS, inputs, [squares.output[0], node.output[0]])
        new[id(squares)] = [basis, made]
        new[id(node)] = []
    placed: set[str] = set()
    result = []
    for node in nodes:
        for own_node in new.get(id(node), [node]):
            if own_node.op_type != FIXED or own_node.output[0] not in placed:
                result.append(own_node)
            placed |= {*own_node.output}
    return result


def _basis(found: _Residuals, known: dict[str, Tensor]) -> Any:
    """The node of all monomials of residuals; at zero where no coordinate is solved for."""
    from onnx import helper

    monomials = found.monomials
    values = np.ascontiguousarray(monomials.values.astype(np.float32))
    stem = f"fixed_{zlib.crc32(values.tobytes()):08x}"
    known[f"{stem}_values"] = Tensor.constant(values, f"{stem}_values")
    powers = monomials.powers.astype(np.int64)
    known[f"{stem}_powers"] = Tensor.constant(powers, f"{stem}_powers")
    solved = monomials.solved or f"{stem}_zero"
    if not monomials.solved:
        known[solved] = Tensor.constant(np.zeros_like(values[:1]), solved)
    inputs = [solved, f"{stem}_values", f"{stem}_powers"]
    return helper.make_node(FIXED, inputs, [f"{stem}_{solved}"])


def _product(found: _Residuals, name: str) -> Any:
    from onnx import helper

    monomials = found.monomials
    values = np.ascontiguousarray(monomials.values.astype(np.float32))
    stem = f"fixed_{zlib.crc32(values.tobytes()):08x}"
    return helper.make_node("MatMul", [found.system, f"{stem}_{monomials.solved}"], [name])
