"""Operators whose result depends on the order or truth of elements."""

from __future__ import annotations

from soilml.errors import ModelFileError
from training.export_c.loops import indices_of, nest, offset
from training.export_c.node import Node, Translation
from training.export_c.program import Program
from training.export_c.sizes import Size, total
from training.export_c.tensor import Tensor


def translate_compress(program: Program, node: Node) -> list[Tensor]:
    """The slices along an axis, the first one, whose condition is true."""
    x, condition = program.stored(node.input(0)), program.stored(node.input(1))
    if "axis" not in node.attributes:
        x = x.seen_as((x.count,))
    if node.axis(x.rank) != 0:
        raise ModelFileError("operator Compress along another axis than the first is not known")
    inner = total(x.shape[1:])
    count = program.count(x.shape[0])
    out = program.new(x.kind, (Size.of(count), *x.shape[1:]))
    j = indices_of([inner], 1)[0]
    target = offset([inner, Size(1)], [count, j])
    source = offset([inner, Size(1)], ["i0", j])
    copy = nest([inner], [j], f"{out.name}[{target}] = {x.name}[{source}];")
    lines = [
        f"    int {count} = 0;",
        f"    for (int i0 = 0; i0 < {condition.count.c}; ++i0)",
        f"        if ({condition.name}[i0]) {{",
        "\n".join("        " + line for line in copy.splitlines()),
        f"            ++{count};",
        "        }",
    ]
    program.emit("\n".join(lines), out, x, condition)
    return [out]


def translate_top(program: Program, node: Node) -> list[Tensor]:
    """The largest or smallest elements along the last axis, in order, and their indices."""
    x, count = program.stored(node.input(0)), (node.numbers(1, "k") or [1])[0]
    if node.axis(x.rank, -1) != x.rank - 1:
        raise ModelFileError("operator TopK along another axis than the last is not known")
    largest = int(node.attributes.get("largest", 1))
    shape = (*x.shape[:-1], Size(count))
    out, where = program.new(x.kind, shape), program.new("int", shape)
    outer = [total(x.shape[:-1])]
    i = indices_of(outer)
    kernel = program.shared.kernel("largest_few" if largest else "smallest_few", x.kind)
    at_x, at_out = offset([x.shape[-1]], i), offset([Size(count)], i)
    call = (
        f"{kernel}({x.name} + {at_x}, {x.shape[-1].c}, {count}, {out.name} + {at_out}, "
        f"{where.name} + {at_out});"
    ).replace(" + 0", "")
    program.emit(nest(outer, i, call), out, where, x)
    return [out, where]


def translate_extreme_index(program: Program, node: Node) -> list[Tensor]:
    """The index of the largest or smallest element along the last axis; the first of equal ones."""
    x = program.stored(node.input(0))
    if node.axis(x.rank) != x.rank - 1 or int(node.attributes.get("select_last_index", 0)):
        raise ModelFileError(f"operator {node.kind} along another axis than the last is not known")
    keep = int(node.attributes.get("keepdims", 1))
    out = program.new("int", (*x.shape[:-1], *([Size(1)] if keep else [])))
    outer = [total(x.shape[:-1])]
    i = indices_of(outer)
    sign = ">" if node.kind == "ArgMax" else "<"
    first = offset([x.shape[-1]], i)
    element, best = f"{x.name}[{first} + k]", f"{x.name}[{first} + {out.name}[{i[0]}]]"
    body = (
        f"{{\n    {out.name}[{i[0]}] = 0;\n    for (int k = 1; k < {x.shape[-1].c}; ++k)\n"
        f"        if ({element} {sign} {best})\n            {out.name}[{i[0]}] = k;\n}}"
    )
    program.emit(nest(outer, i, body), out, x)
    return [out]


OPERATORS: dict[str, Translation] = {
    "Compress": translate_compress,
    "TopK": translate_top,
    "ArgMax": translate_extreme_index,
    "ArgMin": translate_extreme_index,
}
