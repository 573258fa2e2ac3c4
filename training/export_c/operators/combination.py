"""Operators that combine elements along axes: products of matrices, reductions, quantiles."""

from __future__ import annotations

from math import prod

from soilml.errors import ModelFileError
from training.export_c.c_text import at, indices_of, nest, number, offset
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Shape, Tensor, broadcast, strides

#: Kernels of reductions.
REDUCTIONS = {
    "ReduceSum": "sum_of", "ReduceMean": "sum_of", "ReduceSumSquare": "squares_of",
    "ReduceMax": "largest_of", "ReduceMin": "smallest_of",
}  # fmt: skip


def translate_gemm(program: Program, node: Node) -> list[Tensor]:
    """`alpha a b + c` of two matrices, one of which may be transposed."""
    a, b, c = program.stored(node.input(0)), program.stored(node.input(1)), node.optional(2)
    transpose_a, transpose_b = (int(node.attributes.get(k, 0)) for k in ("transA", "transB"))
    alpha, beta = (float(node.attributes.get(k, 1.0)) for k in ("alpha", "beta"))
    if (transpose_a and transpose_b) or beta != 1.0:
        raise ModelFileError("this form of operator Gemm is not known to export c")
    m, k = (a.shape[1], a.shape[0]) if transpose_a else a.shape
    n = b.shape[0] if transpose_b else b.shape[1]
    text, given = (number(0.0, a.kind), []) if c is None else ("{0}", [c])
    out = program.stored(program.computed(a.kind, (m, n), text, given))
    steps = (1, m) if transpose_a else (k, 1)
    code = _product(program, (m, k, n), alpha, (a, "0", *steps), (b, "0"), (out, "0"), transpose_b)
    program.emit(f"    {code}", out, a, b)
    return [out]


def translate_matmul(program: Program, node: Node) -> list[Tensor]:
    """A product of matrices or vectors, for each pair of a batch."""
    a, b = program.stored(node.input(0)), program.stored(node.input(1))
    left = a.seen_as((1, *a.shape)) if a.rank == 1 else a
    right = b.seen_as((*b.shape, 1)) if b.rank == 1 else b
    batch = broadcast([left.shape[:-2], right.shape[:-2]])
    m, k, n = *left.shape[-2:], right.shape[-1]
    out = program.stored(program.computed(a.kind, (*batch, m, n), number(0.0, a.kind), []))
    i = indices_of(batch)
    first, other = (_offset(t, batch, i) for t in (left, right))
    place = offset(strides(out.shape)[: len(batch)], i)
    code = _product(program, (m, k, n), 1.0, (left, first, k, 1), (right, other), (out, place), 0)
    program.emit(nest(list(batch), code), out, a, b)
    return [out.seen_as((*batch, *([] if a.rank == 1 else [m]), *([] if b.rank == 1 else [n])))]


def _offset(tensor: Tensor, batch: Shape, indices: list[str]) -> str:
    """Where the matrix of a batch begins in a tensor that may be broadcast over it."""
    own = (1,) * (len(batch) + 2 - tensor.rank) + tensor.shape
    steps = [0 if size == 1 else step for size, step in zip(own, strides(own), strict=True)]
    return offset(steps[:-2], indices)


def _product(
    program: Program,
    sizes: tuple[int, int, int],
    alpha: float,
    left: tuple[Tensor, str, int, int],
    right: tuple[Tensor, str],
    to: tuple[Tensor, str],
    transpose_b: int,
) -> str:
    """A call that adds a product; matrices with where they begin, that of `left` with its steps."""
    (a, first, row, step), (m, k, n) = left, sizes
    transposed_ = transpose_b or (n == 1 and step == 1)  # a column is a row by its side
    kernel = program.shared.kernel(f"add_product{'_transposed' if transposed_ else ''}", a.kind)
    steps = f"{row}" if transposed_ else f"{row}, {step}"
    return (
        f"{kernel}({m}, {k}, {n}, {number(alpha, a.kind)}, {at(a, first)}, {steps}, {at(*right)}, "
        f"{at(*to)});"
    )


def translate_reduction(program: Program, node: Node) -> list[Tensor]:
    """A reduction over one axis or all."""
    x = program.stored(node.input(0))
    listed = node.numbers(1, "axes") or list(range(x.rank))
    if len(listed) not in (1, x.rank):
        raise ModelFileError(f"operator {node.kind} over several axes is not known to export c")
    first = listed[0] % x.rank if len(listed) == 1 else 0
    last = first + len(listed)
    kept = [1] * len(listed) if int(node.attributes.get("keepdims", 1)) else []
    shape = (*x.shape[:first], *kept, *x.shape[last:])
    before, along, after = (
        prod(part) for part in (x.shape[:first], x.shape[first:last], x.shape[last:])
    )
    out = program.new(x.kind, shape)
    kernel = program.shared.kernel(REDUCTIONS[node.kind], x.kind)
    i, j = indices_of([before, after])
    source, target = offset([along * after, 1], [i, j]), offset([after, 1], [i, j])
    body = f"{out.name}[{target}] = {kernel}({at(x, source)}, {along}, {after});"
    program.emit(nest([before, after], body), out, x)
    if node.kind == "ReduceMean":
        return [program.computed(x.kind, shape, f"{{0}} / {number(along, x.kind)}", [out])]
    return [out]


def translate_quantiles(program: Program, node: Node) -> list[Tensor]:
    """The composite `training.set_posterior.posterior_summary.add_quantiles`."""
    deviations, std, weights, grid, spacing, ends = (program.stored(t) for t in node.given())
    q, n = deviations.shape
    out, kernel = program.new("float", (2, q)), program.shared.kernel("quantiles", "float")
    assert grid.value is not None and spacing.value is not None
    near, far = int(abs(grid.value).min()), int(abs(grid.value).max())
    cells = program.new("float", (4 * far + 6,))
    code = (
        f"    {kernel}({q}, {n}, {deviations.name}, {std.name}, {weights.name}, {near}, {far}, "
        f"{number(spacing.value.flat[0], 'float')}, {ends.name}, {cells.name}, {out.name});"
    )
    program.emit(code, out, cells, deviations, std, weights)
    return [out]


OPERATORS: dict[str, Translation] = {
    "Gemm": translate_gemm,
    "MatMul": translate_matmul,
    **dict.fromkeys(REDUCTIONS, translate_reduction),
    "Quantiles": translate_quantiles,
}
