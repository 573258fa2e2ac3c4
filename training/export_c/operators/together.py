"""Operators that stand for several nodes of a graph (`training.export_c.joined_nodes`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from training.export_c.c_text import (
    INDENT,
    element,
    element_loops,
    indices_of,
    leaves_of,
    nest,
    number,
    offset,
)
from training.export_c.integrated_errors import (
    APART,
    FACTOR,
    INTEGRATION,
    MEAN,
    ROWS,
    SQUARES,
    SUMS,
)
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Expression, Size, Tensor, strides, total

#: Rows of a system begin at multiples of so many numbers.
GRAIN = 4
FEW_ROWS = 20  # A system of so many rows keeps them all


def translate_integration(program: Program, node: Node) -> list[Tensor]:
    """The system of the first columns, with the errors of the others integrated out, in turn.

    Inputs: systems (m, columns) or (scales, m, columns), or parts of their columns.
    Outputs: the systems, and for each error its determinant, (scales, 1, 1).
    """
    parts = [t if t.expression is not None else program.stored(t) for t in node.given()]
    errors = int(node.attributes["errors"])
    *batch, m, _ = parts[0].shape
    columns = sum((part.shape[-1] for part in parts), Size(0)).constant
    kept = columns - errors
    kind = parts[0].kind
    system = program.new(kind, (m, Size(columns)))
    shape = (*batch, m, Size(kept))
    # of one system, rows are moved together in its place
    out = program.new(kind, shape) if batch else system.block(Size(0), shape)
    change = program.new(kind, (Size(columns),))
    count = batch[0] if batch else Size(1)
    determinants = program.new(kind, (Size(errors), count))
    outer = indices_of(batch)
    lines, start = [], 0
    for part in parts:
        own = [*outer, *indices_of(part.shape[-2:], len(outer))]
        to = offset([Size(columns), Size(1)], own[-2:])
        to = f"{start} + {to}" if start else to
        body = f"{system.name}[{to}] = {_element(part, own)};"
        lines.append(nest(part.shape[-2:], own[-2:], body))
        start += part.shape[-1].constant
    kernel = program.shared.kernel("integrate_out", kind)
    place = offset([count, Size(1)], ["error", outer[0] if outer else "0"])
    lines += [
        f"    for (int error = 0; error < {errors}; ++error)",
        f"        {determinants.name}[{place}] = "
        f"{kernel}({m.c}, {columns - 1} - error, {columns}, {system.name}, {change.name});",
    ]
    own = [*outer, *indices_of(out.shape[-2:], len(outer))]
    source = offset([Size(columns), Size(1)], own[-2:])
    target = offset(strides(out.shape), own)
    lines.append(nest(out.shape[-2:], own[-2:], f"{out.name}[{target}] = {system.name}[{source}];"))
    text = "\n".join(lines)
    if batch:
        inside = "\n".join(line.removeprefix(INDENT) for line in text.splitlines())
        text = nest(
            batch, outer, "{\n" + "\n".join(INDENT + x for x in inside.splitlines()) + "\n}"
        )
    leaves = [leaf for t in parts for leaf in (leaves_of(t.expression) if t.expression else [t])]
    same = leaves if len(parts) == 1 and not batch else []
    program.emit(text, out, system, change, determinants, *leaves, replaceable=same)
    one = (*([count] if batch else []), *[Size(1)] * 2)
    return [out, *(determinants.block(count * k, one) for k in range(errors))]


def _element(tensor: Tensor, indices: list[str]) -> str:
    if tensor.expression is not None:
        return element(tensor.shape, tensor.expression, indices)
    return f"{tensor.name}[{offset(strides(tensor.shape), indices)}]"


def translate_products_of_rows(program: Program, node: Node) -> list[Tensor]:
    """Products of two rows each of one matrix, whose numbers are constant."""
    x, one, other = (program.stored(_as_indices(node.input(k))) for k in range(3))
    m, n = one.shape[0], total(x.shape[1:])
    out = program.new(x.kind, (m, *x.shape[1:]))
    kernel = program.shared.kernel("products_of_rows", x.kind)
    code = f"    {kernel}({m.c}, {n.c}, {one.name}, {other.name}, {x.name}, {out.name});"
    program.emit(code, out, x)
    return [out]


def _as_indices(tensor: Tensor) -> Tensor:
    """Constant row numbers as int; other tensors as they are."""
    if tensor.value is None or tensor.kind != "int":
        return tensor
    return Tensor.constant(tensor.value.astype(np.int32), "")


def translate_gauss_newton_sums(program: Program, node: Node) -> list[Tensor]:
    """Sums over residuals of squares of their derivatives, and of their products with these.

    Inputs: a system (m, k) and its monomials (k, n); a system (m, columns) and the derivatives'
    monomials (l, n), whose coefficients are l columns of it times factors: their numbers, and the
    factors; further rows of both systems, if there are any.
    """
    given = [program.stored(_as_indices(t)) for t in node.given()]
    system, basis, other, slope_basis, picked, factors, *further = given
    k, n, few = *basis.shape, slope_basis.shape[0]
    squares, products = (program.new(basis.kind, (Size(1), n)) for _ in range(2))
    slope = program.new(basis.kind, (few * 2,))
    kernel, zero = program.shared.kernel("gauss_newton_sums", basis.kind), number(0.0, basis.kind)
    lines = [
        f"    for (int i0 = 0; i0 < {n.c}; ++i0)",
        f"        {squares.name}[i0] = {products.name}[i0] = {zero};",
    ]
    pairs = [(system, other), *((rows, rows) for rows in further)]
    lines += [
        f"    {kernel}({own.shape[0].c}, {k.c}, {few.c}, {n.c}, {own.name}, {basis.name}, "
        f"{source.shape[1].c}, {source.name},\n        {picked.name}, {factors.name}, "
        f"{slope_basis.name}, {slope.name}, {squares.name}, {products.name});"
        for own, source in pairs
    ]
    read = [tensor for pair in pairs for tensor in pair]
    constants = [basis, slope_basis, picked, factors]
    program.emit("\n".join(lines), squares, products, slope, *constants, *read)
    return [squares, products]


def translate_errors_apart(program: Program, node: Node) -> list[Tensor]:
    """A system and its errors in rows of which the first alone have errors.

    Inputs: system (m, n), errors (m, e), and their sizes (scales, 1, e).
    Outputs: the system, with e rows at least; for each scale the matrix (e, e) by which its first
    rows are whitened; and for each error its determinant, (scales, 1, 1).
    """
    own, columns, sizes = (program.stored(node.input(k)) for k in range(3))
    (m, n), e, scales = own.shape, columns.shape[1].constant, sizes.shape[0]
    width = n.constant + e
    step = -(-width // GRAIN) * GRAIN
    count = program.count_up_to(max(m.most(program.bounds), e))
    system = program.new(own.kind, (Size.of(count), Size(step)))
    out = program.new(own.kind, (Size.of(count), n))
    matrices = program.new(own.kind, (scales, Size(e), Size(e)))
    determinants = program.new(own.kind, (Size(e), scales))
    small, change = (program.new(own.kind, s) for s in ((Size(e), Size(2 * e)), (Size(step),)))
    reflect, integrate, largest, not_zero = (
        program.shared.kernel(name, own.kind)
        for name in ("reflect", "integrate_out", "largest_column", "not_zero")
    )
    zero, one = number(0.0, own.kind), number(1.0, own.kind)
    place = f"{system.name}[i0 * {step}"
    code = f"""    int {count} = 0;
    {count} = {m.c} < {e} ? {e} : {m.c};
    for (int i0 = 0; i0 < {count}; ++i0)
        for (int i1 = 0; i1 < {step}; ++i1)
            {place} + i1] = {zero};
    for (int i0 = 0; i0 < {m.c}; ++i0) {{
        for (int i1 = 0; i1 < {n.c}; ++i1)
            {place} + i1] = {own.name}[i0 * {n.c} + i1];
        for (int i1 = 0; i1 < {e}; ++i1)
            {place} + {n.c} + i1] = {columns.name}[i0 * {e} + i1];
    }}"""
    program.emit(code, system, own, columns)
    # a row that has no error takes a monomial, so that the other rows are fewer
    code = f"""    for (int error = 0; error < {e}; ++error) {{
        int pivot = {n.c} + error, given = 0;
        for (int i0 = error; i0 < {count}; ++i0)
            given += {not_zero}({system.name}[i0 * {step} + pivot]) ? 1 : 0;
        if (given == 0)
            pivot = {largest}({count}, {n.c}, {step}, error, {system.name}, {change.name});
        {reflect}({count}, {width}, {step}, error, pivot, {system.name}, {change.name});
    }}
    for (int i0 = 0; i0 < {count}; ++i0)
        for (int i1 = 0; i1 < {n.c}; ++i1)
            {out.name}[i0 * {n.c} + i1] = {place} + i1];
    for (int scale = 0; scale < {scales.c}; ++scale) {{
        for (int i0 = 0; i0 < {e}; ++i0)
            for (int i1 = 0; i1 < {e}; ++i1) {{
                {small.name}[i0 * {2 * e} + i1] = i0 == i1 ? {one} : {zero};
                {small.name}[i0 * {2 * e} + {e} + i1] =
                    {place} + {n.c} + i1] * {sizes.name}[scale * {e} + i1];
            }}
        for (int error = 0; error < {e}; ++error)
            {determinants.name}[error * {scales.c} + scale] =
                {integrate}({e}, {2 * e - 1} - error, {2 * e}, {small.name}, {change.name});
        for (int i0 = 0; i0 < {e}; ++i0)
            for (int i1 = 0; i1 < {e}; ++i1)
                {matrices.name}[(scale * {e} + i0) * {e} + i1] = {small.name}[i0 * {2 * e} + i1];
    }}"""
    program.emit(code, out, system, matrices, determinants, small, change, sizes)
    shape = (scales, Size(1), Size(1))
    return [out, matrices, *(determinants.block(scales * k, shape) for k in range(e))]


def translate_factor(program: Program, node: Node) -> list[Tensor]:
    """A system of fewer rows with the same sums of squares, of all rows but some first ones.

    Outputs: that system; and the first rows, which need not be kept with the others.
    """
    x = program.stored(node.input(0))
    n = x.shape[1]
    skipped = int(node.attributes["skipped"])
    top = program.new(x.kind, (Size(skipped), n))
    if skipped:
        program.emit(
            element_loops(top.name, top.shape, Expression("{0}", (x.block(Size(0), top.shape),))),
            top,
            x,
        )
    x = x.block(n * skipped, (x.shape[0] + -skipped, n))
    m = x.shape[0]
    count = program.count_up_to(min(m.most(program.bounds), max(n.constant, FEW_ROWS)))
    system = program.new(x.kind, x.shape)
    rest, change = program.new(x.kind, (n,)), program.new(x.kind, (n,))
    program.emit(element_loops(system.name, x.shape, Expression("{0}", (x,))), system, x)
    kernel = program.shared.kernel("factor_rows", x.kind)
    code = (
        f"    int {count} = 0;\n    {count} = "
        f"{kernel}({m.c}, {n.c}, {system.name}, {rest.name}, {change.name});"
    )
    program.emit(code, system, rest, change)
    return [replace(system, shape=(Size.of(count), n)), top]


def translate_squares(program: Program, node: Node) -> list[Tensor]:
    """Sums of squared residuals for each scale of the errors.

    Inputs: the first rows (e, n) of a system, which have the errors, the matrices (scales, e, e) by
    which these are whitened, a system with the sums of squares of the others, and monomials
    (n, points).
    """
    system, matrices, rest, basis = (program.stored(node.input(k)) for k in range(4))
    scales, e, _ = matrices.shape
    k, n = basis.shape
    out, top, common = (program.new(basis.kind, (size, n)) for size in (scales, e, Size(1)))
    squares, product = (
        program.shared.kernel(name, basis.kind) for name in ("squares_of_product", "add_product")
    )
    one, of_scale = number(1.0, basis.kind), f"{matrices.name} + i0 * {(e * e).c}"
    code = f"""    for (int i0 = 0; i0 < {(e * n).c}; ++i0)
        {top.name}[i0] = {number(0.0, basis.kind)};
    {product}({e.c}, {k.c}, {n.c}, {one}, {system.name}, {k.c}, 1, {basis.name}, {top.name});
    {squares}({rest.shape[0].c}, {k.c}, {n.c}, {rest.name}, {basis.name}, {common.name});
    for (int i0 = 0; i0 < {scales.c}; ++i0) {{
        {squares}({e.c}, {e.c}, {n.c}, {of_scale}, {top.name}, {out.name} + i0 * {n.c});
        for (int i1 = 0; i1 < {n.c}; ++i1)
            {out.name}[i0 * {n.c} + i1] += {common.name}[i1];
    }}"""
    program.emit(code, out, top, common, system, matrices, rest, basis)
    return [out]


def translate_mean(program: Program, node: Node) -> list[Tensor]:
    """The mean over scales of the first rows of a system, by their shares (1, scales)."""
    system, matrices, shares = (program.stored(node.input(k)) for k in range(3))
    scales, e, _ = matrices.shape
    n = system.shape[1]
    mean, out = program.new(system.kind, (e, e)), program.new(system.kind, (e, n))
    product, zero = program.shared.kernel("add_product", system.kind), number(0.0, system.kind)
    one, square, first = number(1.0, system.kind), (e * e).c, (e * n).c
    code = f"""    for (int i0 = 0; i0 < {square}; ++i0)
        {mean.name}[i0] = {zero};
    {product}(1, {scales.c}, {square}, {one}, {shares.name}, {scales.c}, 1, {matrices.name},
        {mean.name});
    for (int i0 = 0; i0 < {first}; ++i0)
        {out.name}[i0] = {zero};
    {product}({e.c}, {e.c}, {n.c}, {one}, {mean.name}, {e.c}, 1, {system.name}, {out.name});"""
    program.emit(code, out, mean, system, matrices, shares)
    return [out]


OPERATORS: dict[str, Translation] = {
    APART: translate_errors_apart,
    FACTOR: translate_factor,
    INTEGRATION: translate_integration,
    MEAN: translate_mean,
    ROWS: translate_products_of_rows,
    SQUARES: translate_squares,
    SUMS: translate_gauss_newton_sums,
}
