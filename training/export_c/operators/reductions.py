"""Operators that combine, order or select elements along axes."""

from __future__ import annotations

from soilml.errors import ModelFileError
from training.export_c.c_text import INDENT, indices_of, nest, offset
from training.export_c.operators.rearrangement import transposed
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Shape, Size, Tensor, strides, total

#: Kernel of each reduction over neighbouring elements: its name; the first value, from the first
#: element where it begins with one; and one step of the total t with the element x.
REDUCTIONS = {
    "ReduceSum": ("sum_of", "0", "{t} += {x};"),
    "ReduceMean": ("sum_of", "0", "{t} += {x};"),
    "ReduceSumSquare": ("squares_of", "0", "{t} += {x} * {x};"),
    "ReduceMax": ("largest_of", "{x}", "{t} = {x} > {t} ? {x} : {t};"),
    "ReduceMin": ("smallest_of", "{x}", "{t} = {x} < {t} ? {x} : {t};"),
}


def translate_reduction(program: Program, node: Node) -> list[Tensor]:
    """A reduction over some axes or all."""
    x = program.stored(node.input(0))
    listed = node.numbers(1, "axes")
    if not listed and int(node.attributes.get("noop_with_empty_axes", 0)):
        return [x]
    axes = sorted({axis % x.rank for axis in listed}) if listed else list(range(x.rank))
    kept = [axis for axis in range(x.rank) if axis not in axes]
    if int(node.attributes.get("keepdims", 1)):
        shape = tuple(Size(1) if axis in axes else size for axis, size in enumerate(x.shape))
    else:
        shape = tuple(x.shape[axis] for axis in kept)
    if axes and axes != list(range(axes[0], axes[-1] + 1)):
        x = transposed(program, x, kept + axes)
        axes = list(range(len(kept), x.rank))
    if not axes:
        return [x.seen_as(shape)]
    before, after = x.shape[: axes[0]], x.shape[axes[-1] + 1 :]
    along = total(x.shape[axes[0] : axes[-1] + 1])
    reduced = _reduced(program, node.kind, x, (total(before), along, total(after)), shape)
    if node.kind == "ReduceMean":
        return [program.computed(x.kind, shape, f"{{0}} / ({x.kind}){along.c}", [reduced])]
    return [reduced]


def _reduced(
    program: Program, kind: str, x: Tensor, sizes: tuple[Size, Size, Size], shape: Shape
) -> Tensor:
    """A tensor seen as (before, along, after), reduced over its middle axis."""
    out = program.new(x.kind, shape)
    before, along, after = sizes
    kernel, start, step = REDUCTIONS[kind]
    if after == Size(1):
        name = program.shared.kernel(kernel, x.kind)
        index = indices_of([before])
        place = offset([along], index)
        source = x.name if place == "0" else f"{x.name} + {place}"
        body = f"{out.name}[{index[0]}] = {name}({source}, {along.c});"
        program.emit(nest([before], index, body), out, x)
        return out
    outer, k, inner = [before], "k", [after]
    (i,), (j,) = indices_of(outer), indices_of(inner, 1)
    steps = strides(sizes)
    first = offset([steps[0], Size(1)], [i, j])
    target = f"{out.name}[{offset([after, Size(1)], [i, j])}]"
    element = f"{x.name}[{offset([steps[0], steps[1], Size(1)], [i, k, j])}]"
    begin = start.format(x=f"{x.name}[{first}]")
    lines = [
        nest(inner, [j], f"{target} = {begin};"),
        f"{INDENT}for (int k = 0; k < {along.c}; ++k)",
        INDENT + nest(inner, [j], step.format(t=target, x=element)).replace("\n", f"\n{INDENT}"),
    ]
    body = "\n".join(line.removeprefix(INDENT) for part in lines for line in part.splitlines())
    program.emit(nest(outer, [i], "{\n" + _indented(body) + "\n}"), out, x)
    return out


def translate_softmax(program: Program, node: Node) -> list[Tensor]:
    """Exponentials over their sum along the last axis."""
    x = program.stored(node.input(0))
    if node.axis(x.rank, -1) != x.rank - 1:
        raise ModelFileError("operator Softmax along another axis than the last is not known")
    out, along = program.new(x.kind, x.shape), x.shape[-1]
    kernel = program.shared.kernel("softmax", x.kind)
    index = indices_of([total(x.shape[:-1])])
    place = offset([along], index)
    body = f"{kernel}({x.name} + {place}, {along.c}, {out.name} + {place});".replace(" + 0", "")
    program.emit(nest([total(x.shape[:-1])], index, body), out, x)
    return [out]


def _indented(text: str) -> str:
    return "\n".join(INDENT + line for line in text.splitlines())


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
    """The largest elements along the last axis, in order, and their indices."""
    x, count = program.stored(node.input(0)), (node.numbers(1, "k") or [1])[0]
    if node.axis(x.rank, -1) != x.rank - 1 or not int(node.attributes.get("largest", 1)):
        raise ModelFileError(
            "operator TopK along another axis than the last, or of the least, is not known"
        )
    shape = (*x.shape[:-1], Size(count))
    out, where = program.new(x.kind, shape), program.new("int", shape)
    outer = [total(x.shape[:-1])]
    i = indices_of(outer)
    kernel = program.shared.kernel("largest_few", x.kind)
    at_x, at_out = offset([x.shape[-1]], i), offset([Size(count)], i)
    call = (
        f"{kernel}({x.name} + {at_x}, {x.shape[-1].c}, {count}, {out.name} + {at_out}, "
        f"{where.name} + {at_out});"
    ).replace(" + 0", "")
    program.emit(nest(outer, i, call), out, where, x)
    return [out, where]


OPERATORS: dict[str, Translation] = {
    **dict.fromkeys(REDUCTIONS, translate_reduction),
    "Softmax": translate_softmax,
    "Compress": translate_compress,
    "TopK": translate_top,
}
