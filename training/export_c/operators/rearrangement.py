"""Operators that move elements: parts joined, cut out, picked, transposed, repeated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.errors import ModelFileError
from training.export_c.c_text import copied_rows, indices_of, nest, offset
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Size, Tensor, broadcast, strides, total


def translate_concat(program: Program, node: Node) -> list[Tensor]:
    """Tensors one after another along an axis."""
    given = [t for t in node.given() if t.count != Size(0)]
    if given[0].rank == 1 and all(t.kind == "int" and _is_known(t) for t in given):
        sizes = tuple(size for t in given for size in t.as_sizes("a size"))
        return [Tensor("", "int", (Size(len(sizes)),), sizes=sizes)]
    parts = [program.stored(t) for t in given]
    axis = node.axis(parts[0].rank)
    along = sum((t.shape[axis] for t in parts), Size(0))
    shape = (*parts[0].shape[:axis], along, *parts[0].shape[axis + 1 :])
    out, start = program.new(parts[0].kind, shape), Size(0)
    for part in parts:
        _copy_part(program, out, part, axis, start, into_whole=True)
        start = start + part.shape[axis]
    return [out]


def translate_split(program: Program, node: Node) -> list[Tensor]:
    """Consecutive parts along an axis."""
    x = program.stored(node.input(0))
    axis = node.axis(x.rank)
    listed = node.numbers(1, "split")
    lengths = _equal_parts(x.shape[axis], node.outputs) if listed is None else listed
    starts = [0, *np.cumsum(lengths).tolist()]
    return [
        _slice(program, x, axis, Size(int(start)), Size(length))
        for start, length in zip(starts, lengths, strict=False)
    ]


def _equal_parts(size: Size, parts: int) -> list[int]:
    if not size.fixed:
        raise ModelFileError("operator Split of a variable dimension is not known to export-c")
    length = -(-size.constant // parts)
    return [min(length, size.constant - length * k) for k in range(parts)]


def translate_slice(program: Program, node: Node) -> list[Tensor]:
    """A block of a tensor, by the first and last index along some axes."""
    x = node.input(0)
    starts, ends = node.numbers(1, "starts") or [], node.numbers(2, "ends") or []
    axes = node.numbers(3, "axes") or list(range(len(starts)))
    if any(step != 1 for step in node.numbers(4, "steps") or []):
        raise ModelFileError("operator Slice with steps is not known to export-c")
    for axis, start, end in zip(axes, starts, ends, strict=True):
        a = axis % x.rank
        first, last = (_limited(bound, x.shape[a]) for bound in (start, end))
        length = last + first * -1
        if x.sizes is not None:
            x = Tensor("", "int", (length,), sizes=x.sizes[first.constant : last.constant])
        else:
            x = _slice(program, program.stored(x), a, first, length)
    return [x]


def _limited(bound: int, size: Size) -> Size:
    """An index of a slice, which may count from the end or lie beyond it."""
    if bound < 0:
        return size + bound if not size.fixed else Size(max(size.constant + bound, 0))
    return Size(min(bound, size.constant)) if size.fixed else Size(bound) if bound < 2**30 else size


def translate_gather(program: Program, node: Node) -> list[Tensor]:
    """Elements along an axis, picked by their indices."""
    x, picked = node.input(0), node.input(1)
    axis = node.axis(x.rank)
    if x.sizes is not None:
        sizes = tuple(x.sizes[k] for k in picked.numbers("an index of Gather"))
        return [Tensor("", "int", picked.shape, sizes=sizes)]
    x = program.stored(x)
    outer, inner = total(x.shape[:axis]), total(x.shape[axis + 1 :])
    shape = (*x.shape[:axis], *picked.shape, *x.shape[axis + 1 :])
    along = x.shape[axis]
    if picked.value is not None and along.fixed:
        values = picked.value.reshape(-1) % along.constant
        if len(values) == 1 or np.array_equal(np.diff(values), np.ones(len(values) - 1)):
            block = _slice(program, x, axis, Size(int(values[0])), Size(len(values)))
            return [block.seen_as(shape)]
        picked = Tensor.constant(values.astype(np.int32), "")
    picked = program.stored(picked)
    out = program.new(x.kind, shape)
    sizes_ = (outer, picked.count, inner)
    i, j, k = indices_of(sizes_)
    index = f"{picked.name}[{j}]"
    target = offset(strides(sizes_), [i, j, k])
    source = offset([along * inner, inner, Size(1)], [i, index, k])
    code = nest(sizes_, [i, j, k], f"{out.name}[{target}] = {x.name}[{source}];")
    program.emit(code, out, x, picked)
    return [out]


def translate_transpose(program: Program, node: Node) -> list[Tensor]:
    """A tensor with its axes in another order."""
    x = program.stored(node.input(0))
    return [transposed(program, x, node.attributes.get("perm", range(x.rank)[::-1]))]


def transposed(program: Program, x: Tensor, order: Sequence[int]) -> Tensor:
    """A tensor in memory with its axes in this order."""
    shape = tuple(x.shape[axis] for axis in order)
    moved = [axis for axis in order if x.shape[axis] != Size(1)]
    if moved == sorted(moved):
        return x.seen_as(shape)
    out, steps = program.new(x.kind, shape), strides(x.shape)
    indices = indices_of(shape)
    source = offset([steps[axis] for axis in order], indices)
    target = offset(strides(shape), indices)
    program.emit(nest(shape, indices, f"{out.name}[{target}] = {x.name}[{source}];"), out, x)
    return out


def translate_expand(program: Program, node: Node) -> list[Tensor]:
    """A tensor repeated along axes of size 1."""
    x = node.input(0)
    shape = broadcast([x.shape, node.input(1).as_sizes("the shape of Expand")])
    return [program.computed(x.kind, shape, "{0}", [x])]


def translate_reshape(program: Program, node: Node) -> list[Tensor]:
    """The same elements in another shape."""
    x = node.input(0)
    wanted = list(node.input(1).as_sizes("the shape of Reshape"))
    zero_kept = not int(node.attributes.get("allowzero", 0))
    shape = [
        x.shape[axis] if size == Size(0) and zero_kept else size for axis, size in enumerate(wanted)
    ]
    if Size(-1) in shape:
        others = total(tuple(size for size in shape if size != Size(-1)))
        shape[shape.index(Size(-1))] = x.count.over(others)
    if x.expression is not None and x.rank and x.shape[-1:] == tuple(shape[-1:]):
        return [Tensor("", x.kind, tuple(shape), source=x)]  # products can take it row by row
    return [_as_it_is(program, x).seen_as(tuple(shape))]


def translate_squeeze(program: Program, node: Node) -> list[Tensor]:
    """A tensor without axes of size 1."""
    x, listed = _as_it_is(program, node.input(0)), node.numbers(1, "axes")
    axes = [axis % x.rank for axis in listed] if listed is not None else None
    shape = tuple(
        size
        for axis, size in enumerate(x.shape)
        if (axis not in axes if axes is not None else size != Size(1))
    )
    return [x.seen_as(shape)]


def translate_unsqueeze(program: Program, node: Node) -> list[Tensor]:
    """A tensor with further axes of size 1."""
    x, listed = _as_it_is(program, node.input(0)), node.numbers(1, "axes") or []
    rank = x.rank + len(listed)
    axes, own = {axis % rank for axis in listed}, iter(x.shape)
    return [x.seen_as(tuple(Size(1) if k in axes else next(own) for k in range(rank)))]


def translate_identity(program: Program, node: Node) -> list[Tensor]:
    """The tensor itself."""
    return [node.input(0)]


def translate_shape(program: Program, node: Node) -> list[Tensor]:
    """The sizes of a tensor."""
    shape = node.input(0).shape
    first, last = int(node.attributes.get("start", 0)), node.attributes.get("end")
    sizes = shape[first : None if last is None else int(last)]
    return [Tensor("", "int", (Size(len(sizes)),), sizes=sizes)]


def _slice(program: Program, x: Tensor, axis: int, start: Size, length: Size) -> Tensor:
    """A block along one axis; the tensor itself where that is the whole."""
    if start == Size(0) and length == x.shape[axis]:
        return x
    shape = (*x.shape[:axis], length, *x.shape[axis + 1 :])
    if total(x.shape[:axis]) == Size(1) and x.value is None:
        return x.block(start * total(x.shape[axis + 1 :]), shape)
    out = program.new(x.kind, shape)
    _copy_part(program, out, x, axis, start, into_whole=False)
    return out


def _copy_part(
    program: Program, out: Tensor, x: Tensor, axis: int, start: Size, into_whole: bool
) -> None:
    """Copy a tensor into a larger one (`into_whole`), or a block of it into a smaller one."""
    part, whole = (x, out) if into_whole else (out, x)
    inner = total(part.shape[axis + 1 :])
    sizes = (total(part.shape[:axis]), part.shape[axis] * inner)
    in_part, in_whole = ("0", sizes[1]), ((start * inner).c, whole.shape[axis] * inner)
    to, source = (in_whole, in_part) if into_whole else (in_part, in_whole)
    program.emit(copied_rows(out, to, x, source, sizes), out, x)


def _is_known(tensor: Tensor) -> bool:
    return tensor.sizes is not None or tensor.value is not None


def _as_it_is(program: Program, tensor: Tensor) -> Tensor:
    return tensor if tensor.sizes is not None else program.stored(tensor)


OPERATORS: dict[str, Translation] = {
    "Concat": translate_concat,
    "Split": translate_split,
    "Slice": translate_slice,
    "Gather": translate_gather,
    "Transpose": translate_transpose,
    "Expand": translate_expand,
    "Reshape": translate_reshape,
    "Squeeze": translate_squeeze,
    "Unsqueeze": translate_unsqueeze,
    "Identity": translate_identity,
    "Shape": translate_shape,
}
