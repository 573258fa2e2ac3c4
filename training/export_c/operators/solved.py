"""Operators on residuals as polynomials of the solved coordinate (`solved_polynomials`)."""

from __future__ import annotations

import numpy as np

from training.export_c.c_text import number
from training.export_c.program import Node, Program, Translation
from training.export_c.solved_polynomials import (
    COEFFICIENTS,
    SOLVED_SCALES,
    SOLVED_SQUARES,
    STEP_SUMS,
)
from training.export_c.tensor import Size, Tensor


def translate_coefficients(program: Program, node: Node) -> list[Tensor]:
    """Coefficients (m * powers, n) of a system (m, k), by monomials (k, n)."""
    system, basis = (program.stored(node.input(k)) for k in range(2))
    ends = np.asarray(node.attributes["ends"], np.int32)
    places = program.stored(Tensor.constant(ends, ""))
    (m, k), n = system.shape, basis.shape[1]
    out = program.new(basis.kind, (m * len(ends), n))
    kernel = program.shared.kernel("solved_coefficients", basis.kind)
    code = (
        f"    {kernel}({m.c}, {k.c}, {n.c}, {system.name}, {basis.name}, "
        f"{len(ends)}, {places.name}, {out.name});"
    )
    program.emit(code, out, system, basis, places)
    return [out]


def translate_step_sums(program: Program, node: Node) -> list[Tensor]:
    """Sums of squared derivatives, and of residuals times derivatives, at a coordinate (1, n)."""
    t, *parts = (program.stored(tensor) for tensor in node.given())
    groups, n, zero = int(node.attributes["groups"]), t.shape[-1], number(0.0, t.kind)
    squares, products = (program.new(t.kind, (Size(1), n)) for _ in range(2))
    kernel = program.shared.kernel("solved_sums", t.kind)
    lines = [
        f"    for (int i0 = 0; i0 < {n.c}; ++i0)",
        f"        {squares.name}[i0] = {products.name}[i0] = {zero};",
    ]
    lines += [
        f"    {kernel}({_rows(part, groups)}, {n.c}, {groups}, {part.name}, {t.name}, "
        f"{squares.name}, {products.name});"
        for part in parts
    ]
    program.emit("\n".join(lines), squares, products, t, *parts)
    return [squares, products]


def translate_solved_squares(program: Program, node: Node) -> list[Tensor]:
    """Sums of squared residuals (1, n) at a coordinate (1, n)."""
    t, part = (program.stored(node.input(k)) for k in range(2))
    groups, n = int(node.attributes["groups"]), t.shape[-1]
    out = program.new(t.kind, (Size(1), n))
    kernel = program.shared.kernel("solved_squares", t.kind)
    arguments = f"{_rows(part, groups)}, {n.c}, {groups}, {part.name}, {t.name}, {out.name}"
    program.emit(f"    {kernel}({arguments});", out, t, part)
    return [out]


def translate_solved_scales(program: Program, node: Node) -> list[Tensor]:
    """The same for each scale of the errors, of first rows, which have them, and of the others."""
    t, first, matrices, rest = (program.stored(node.input(k)) for k in range(4))
    groups, n = int(node.attributes["groups"]), t.shape[-1]
    scales, e, _ = matrices.shape
    out, top, common = (program.new(t.kind, (size, n)) for size in (scales, e, Size(1)))
    values, sums, squares = (
        program.shared.kernel(name, t.kind)
        for name in ("solved_values", "solved_squares", "squares_of_product")
    )
    code = f"""    {values}({e.c}, {n.c}, {groups}, {first.name}, {t.name}, {top.name});
    {sums}({_rows(rest, groups)}, {n.c}, {groups}, {rest.name}, {t.name}, {common.name});
    for (int i0 = 0; i0 < {scales.c}; ++i0) {{
        {squares}({e.c}, {e.c}, {n.c}, {matrices.name} + i0 * {(e * e).c}, {top.name},
            {out.name} + i0 * {n.c});
        for (int i1 = 0; i1 < {n.c}; ++i1)
            {out.name}[i0 * {n.c} + i1] += {common.name}[i1];
    }}"""
    program.emit(code, out, top, common, t, first, matrices, rest)
    return [out]


def _rows(part: Tensor, groups: int) -> str:
    """How many rows of a system coefficients are of."""
    return part.shape[0].over(Size(groups)).c


OPERATORS: dict[str, Translation] = {
    COEFFICIENTS: translate_coefficients,
    STEP_SUMS: translate_step_sums,
    SOLVED_SCALES: translate_solved_scales,
    SOLVED_SQUARES: translate_solved_squares,
}
