"""Products of matrices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.export_c.c_text import element, indices_of, leaves_of, nest, number, offset
from training.export_c.operators.rearrangement import transposed
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Expression, Shape, Size, Tensor, broadcast, strides

#: Constant matrices with fewer columns are multiplied as they are, though they be sparse.
LEAST_SPARSE = 8


def translate_gemm(program: Program, node: Node) -> list[Tensor]:
    """`alpha a b + beta c` of two matrices, either of which may be transposed."""
    a, b, c = node.input(0), node.input(1), node.optional(2)
    transpose_a, transpose_b = (int(node.attributes.get(k, 0)) for k in ("transA", "transB"))
    alpha, beta = (float(node.attributes.get(k, 1.0)) for k in ("alpha", "beta"))
    if transpose_b and not transpose_a and a.shape[0] == Size(1) and b.source is not None:
        # one row times a matrix lies in memory as that matrix times one column
        out = _started(program, a.kind, (Size(1), b.shape[0]), c, beta)
        _emit_by_rows(program, b.source, program.stored(a), alpha, out)
        return [out]
    b = program.stored(b)
    if a.source is not None and transpose_b and not transpose_a:
        out = _started(program, a.kind, (a.shape[0], b.shape[0]), c, beta)
        _emit_by_rows(program, a.source, b, alpha, out)
        return [out]
    a = program.stored(a)
    if transpose_a and transpose_b:
        a, transpose_a = transposed(program, a, [1, 0]), 0
    m, k = (a.shape[1], a.shape[0]) if transpose_a else (a.shape[0], a.shape[1])
    n = b.shape[0] if transpose_b else b.shape[1]
    out = _started(program, a.kind, (m, n), c, beta)
    steps = (Size(1), m) if transpose_a else (k, Size(1))
    at = _Places((a, *steps), b, out)
    _emit(program, (m, k, n), at, alpha=alpha, transpose_b=bool(transpose_b))
    return [out]


def translate_matmul(program: Program, node: Node) -> list[Tensor]:
    """A product of matrices or vectors, for each pair of a batch."""
    picked = _picked_rows(node.input(0), node.input(1))
    if picked is not None:
        return [_multiplied_rows(program, node.input(1), *picked)]
    a, b = program.stored(node.input(0)), program.stored(node.input(1))
    left = a.seen_as((Size(1), *a.shape)) if a.rank == 1 else a
    right = b.seen_as((*b.shape, Size(1))) if b.rank == 1 else b
    batch = broadcast([left.shape[:-2], right.shape[:-2]])
    m, k, n = left.shape[-2], left.shape[-1], right.shape[-1]
    out = _started(program, a.kind, (*batch, m, n), None, 1.0)
    i = indices_of(batch)
    inner = offset(strides(out.shape)[: len(batch)], i)
    offsets = (_offset(left, batch, i), _offset(right, batch, i), inner)
    at = _Places((left, k, Size(1)), right, out, offsets)
    _emit(program, (m, k, n), at, batch=batch)
    shape = (*batch, *([] if a.rank == 1 else [m]), *([] if b.rank == 1 else [n]))
    return [out.seen_as(shape)]


def _picked_rows(a: Tensor, b: Tensor) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Of a constant matrix with one number a row at most: their columns, and the numbers."""
    if a.value is None or a.rank != 2 or b.rank != 2 or a.value.shape[1] < LEAST_SPARSE:
        return None
    if np.count_nonzero(a.value, axis=1).max() > 1:
        return None
    columns = np.abs(a.value).argmax(axis=1)
    return columns, a.value[np.arange(len(columns)), columns]


def _multiplied_rows(
    program: Program, b: Tensor, rows: NDArray[Any], factors: NDArray[Any]
) -> Tensor:
    """Rows of a matrix, each times a factor."""
    b, n = program.stored(b), b.shape[1]
    out = program.new(b.kind, (Size(len(rows)), n))
    row = program.stored(Tensor.constant(rows.astype(np.int32), ""))
    factor = program.stored(Tensor.constant(factors, ""))
    i, j = indices_of(out.shape)
    place, source = offset([n, Size(1)], [i, j]), offset([n, Size(1)], [f"{row.name}[{i}]", j])
    code = f"{out.name}[{place}] = {factor.name}[{i}] * {b.name}[{source}];"
    program.emit(nest(out.shape, [i, j], code), out, b, row, factor)
    return out


def _offset(tensor: Tensor, batch: Shape, indices: list[str]) -> str:
    """Where the matrix of a batch begins in a tensor that may be broadcast over it."""
    own = (Size(1),) * (len(batch) + 2 - tensor.rank) + tensor.shape
    steps = [
        Size(0) if size == Size(1) else step
        for size, step in zip(own[:-2], strides(own)[:-2], strict=True)
    ]
    return offset(steps, indices)


def _started(program: Program, kind: str, shape: Shape, c: Tensor | None, beta: float) -> Tensor:
    """The tensor to which a product is added: zero, or `beta c` broadcast to its shape."""
    if c is None or beta == 0.0:
        zero = number(0.0, kind)
        return program.stored(program.computed(kind, shape, zero, []))
    text = "{0}" if beta == 1.0 else f"{number(beta, kind)} * {{0}}"
    start = program.computed(kind, shape, text, [c])
    return program.stored(start)


@dataclass(frozen=True)
class _Places:
    """Left matrix with its steps along rows and columns, right matrix, product; their offsets."""

    left: tuple[Tensor, Size, Size]
    right: Tensor
    out: Tensor
    offsets: tuple[str, str, str] = ("0", "0", "0")


def _emit(
    program: Program,
    sizes: tuple[Size, Size, Size],
    at: _Places,
    *,
    batch: Shape = (),
    alpha: float = 1.0,
    transpose_b: bool = False,
) -> None:
    (a, row, step), (m, k, n) = at.left, sizes
    names = [
        tensor.name + (f" + {place}" if place != "0" else "")
        for tensor, place in zip((a, at.right, at.out), at.offsets, strict=True)
    ]
    if transpose_b or (n == Size(1) and step == Size(1)):  # a column is a row by its side
        kernel, steps = program.shared.kernel("add_product_transposed", a.kind), row.c
    else:
        kernel, steps = program.shared.kernel("add_product", a.kind), f"{row.c}, {step.c}"
    call = (
        f"{kernel}({m.c}, {k.c}, {n.c}, {number(alpha, a.kind)}, {names[0]}, {steps}, {names[1]}, "
        f"{names[2]});"
    )
    program.emit(nest(list(batch), indices_of(batch), call), at.out, a, at.right)


def _emit_by_rows(program: Program, a: Tensor, b: Tensor, alpha: float, out: Tensor) -> None:
    """Add `alpha a b^T`; rows of `a`, which is an expression, are computed when they are needed.

    A matrix that is used once then needs the memory of one of its rows.
    """
    expression = a.expression
    assert expression is not None
    k, n = b.shape[1], b.shape[0]
    below = _place_and_points(expression) if n == Size(1) and alpha == 1.0 else None
    if below is not None:
        _emit_shares_below(program, a.shape, below, b, out)
        return
    row = program.new(a.kind, (k,))
    indices = indices_of(a.shape)
    inner = nest(
        [k], indices[-1:], f"{row.name}[{indices[-1]}] = {element(a.shape, expression, indices)};"
    )
    place = offset([step * n for step in strides(a.shape[:-1])], indices[:-1])
    kernel = program.shared.kernel("add_product_transposed", a.kind)
    call = (
        f"    {kernel}(1, {k.c}, {n.c}, {number(alpha, a.kind)}, {row.name}, {k.c}, {b.name}, "
        f"{out.name} + {place});"
    )
    body = nest(a.shape[:-1], indices[:-1], f"{{\n{inner}\n{call}\n}}")
    program.emit(body, row, out, b, *leaves_of(expression))


def _place_and_points(expression: Expression) -> tuple[Tensor, Tensor] | None:
    """Of places less points, limited to 0 to 1: places and points; None for another expression."""
    for name, bound in (("at_most", 1.0), ("at_least", 0.0)):
        inner, limit = [*expression.operands, None][:2]
        if not expression.text.startswith(f"{name}_") or inner is None or inner.expression is None:
            return None
        if limit is None or limit.value is None or not np.array_equal(limit.value.flat, [bound]):
            return None
        expression = inner.expression
    if expression.text != "{0} - {1}":
        return None
    place, points = expression.operands
    fits = place.expression is None and place.shape[-1:] == (Size(1),)
    return (place, points) if fits and points.expression is None else None


def _emit_shares_below(
    program: Program, shape: Shape, below: tuple[Tensor, Tensor], weights: Tensor, out: Tensor
) -> None:
    """The weight of the points below each place, with a step that is one wide."""
    if below[0].value is not None and len(shape) > 1 and _whole_apart(below[0].value, shape[-2]):
        _emit_shares_of_grid(program, shape, below, weights, out)
        return
    place, points = (program.stored(tensor) for tensor in below)
    indices = indices_of(shape[:-1])
    for name in ("at_least", "at_most"):
        program.shared.kernel(name, out.kind)
    kernel = program.shared.kernel("share_below", out.kind)
    first, other = (
        element(shape, Expression("{0}", (tensor,)), [*indices, "0"]) for tensor in (place, points)
    )
    target = offset(strides(shape[:-1]), indices)
    code = f"{out.name}[{target}] = {kernel}({shape[-1].c}, {first}, &{other}, {weights.name});"
    program.emit(nest(shape[:-1], indices, code), out, place, points, weights)


def _whole_apart(places: NDArray[Any], count: Size) -> bool:
    """Whether places ascend by whole numbers, the same for each sample."""
    distances = places.reshape(-1) - places.flat[0]
    rising = (np.diff(distances) > 0).all() and (distances == np.rint(distances)).all()
    return bool(Size(places.size) == count and rising)


def _emit_shares_of_grid(
    program: Program, shape: Shape, below: tuple[Tensor, Tensor], weights: Tensor, out: Tensor
) -> None:
    """The weight of the points below each of several places, which are whole numbers apart."""
    places, points = below[0].value, program.stored(below[1])
    assert places is not None
    after = (places.reshape(-1) - places.flat[0]).astype(np.int32)
    distances = program.stored(Tensor.constant(after, ""))
    part, whole = (program.new(out.kind, (Size(int(after[-1]) + 3),)) for _ in range(2))
    indices = [*indices_of(shape[:-2]), "0", "0"]
    other = element(shape, Expression("{0}", (points,)), indices)
    target = offset(strides(shape[:-1]), indices[:-1])
    kernel = program.shared.kernel("shares_below", out.kind)
    code = (
        f"{kernel}({shape[-1].c}, {number(float(places.flat[0]), out.kind)}, {len(after)}, "
        f"{distances.name}, &{other}, {weights.name}, {part.name}, {whole.name}, "
        f"{out.name} + {target});"
    )
    body = nest(shape[:-2], indices[:-2], code)
    program.emit(body, out, part, whole, points, weights, distances)


def squares_of_product(program: Program, a: Tensor, b: Tensor, keepdims: bool) -> Tensor:
    """Sums of squares along the rows of a product of matrices, which needs no memory itself.

    a: A matrix (m, k), or several, (batch, m, k).
    b: One matrix (k, n).
    """
    a, b = program.stored(a), program.stored(b)
    *batch, m, k = a.shape
    n = b.shape[1]
    out = program.new(a.kind, (*batch, n))
    kernel = program.shared.kernel("squares_of_product", a.kind)
    i = indices_of(batch)
    left, target = offset([m * k] * len(batch), i), offset([n] * len(batch), i)
    call = (
        f"{kernel}({m.c}, {k.c}, {n.c}, {a.name} + {left}, {b.name}, {out.name} + {target});"
    ).replace(" + 0", "")
    program.emit(nest(batch, i, call), out, a, b)
    return out.seen_as((*batch, Size(1), n)) if keepdims else out


OPERATORS: dict[str, Translation] = {"Gemm": translate_gemm, "MatMul": translate_matmul}
