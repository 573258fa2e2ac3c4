"""Operators that move elements: parts joined, cut out, picked, transposed, repeated."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from soilml.errors import ModelFileError
from training.export_c.c_text import at, indices_of, nest, offset
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Tensor, broadcast, strides


def translate_concat(program: Program, node: Node) -> list[Tensor]:
    """Tensors one after another along an axis."""
    parts = [program.stored(t) for t in node.given() if t.count]
    axis = node.axis(parts[0].rank)
    along = sum(t.shape[axis] for t in parts)
    shape = (*parts[0].shape[:axis], along, *parts[0].shape[axis + 1 :])
    out, start = program.new(parts[0].kind, shape), 0
    for part in parts:
        _copy(program, (out, start, along), (part, 0, part.shape[axis]), axis)
        start += part.shape[axis]
    return [out]


def translate_split(program: Program, node: Node) -> list[Tensor]:
    """Consecutive parts along an axis."""
    x = program.stored(node.input(0))
    axis, listed = node.axis(x.rank), node.numbers(1, "split")
    size = -(-x.shape[axis] // node.outputs)
    lengths = listed or [min(size, x.shape[axis] - size * k) for k in range(node.outputs)]
    starts = [0, *np.cumsum(lengths).tolist()]
    return [
        _slice(program, x, axis, start, length)
        for start, length in zip(starts, lengths, strict=False)
    ]


def translate_slice(program: Program, node: Node) -> list[Tensor]:
    """A block of a tensor, by the first and last index along some axes."""
    x = program.stored(node.input(0))
    starts, ends = node.numbers(1, "starts") or [], node.numbers(2, "ends") or []
    axes = node.numbers(3, "axes") or list(range(len(starts)))
    if any(step != 1 for step in node.numbers(4, "steps") or []):
        raise ModelFileError("operator Slice with steps is not known to export c")
    for axis, start, end in zip(axes, starts, ends, strict=True):
        chosen = range(x.shape[axis])[start:end]
        x = _slice(program, x, axis % x.rank, chosen.start, len(chosen))
    return [x]


def translate_gather(program: Program, node: Node) -> list[Tensor]:
    """Elements along an axis, picked by their indices."""
    x, picked = program.stored(node.input(0)), node.input(1)
    axis = node.axis(x.rank)
    outer, along, inner = prod(x.shape[:axis]), x.shape[axis], prod(x.shape[axis + 1 :])
    shape = (*x.shape[:axis], *picked.shape, *x.shape[axis + 1 :])
    if picked.value is not None:
        values = picked.value.reshape(-1) % along
        if len(values) == 1 or np.array_equal(np.diff(values), np.ones(len(values) - 1)):
            return [_slice(program, x, axis, int(values[0]), len(values)).seen_as(shape)]
        picked = Tensor.constant(values.astype(np.int32))
    picked = program.stored(picked)
    out, sizes = program.new(x.kind, shape), (outer, picked.count, inner)
    i, j, k = indices_of(sizes)
    target = offset(strides(sizes), [i, j, k])
    source = offset([along * inner, inner, 1], [i, f"{picked.name}[{j}]", k])
    code = nest(sizes, f"{out.name}[{target}] = {x.name}[{source}];")
    program.emit(code, out, x, picked)
    return [out]


def translate_transpose(program: Program, node: Node) -> list[Tensor]:
    """A tensor with its axes in another order."""
    x = program.stored(node.input(0))
    return [transposed(program, x, node.attributes.get("perm", range(x.rank)[::-1]))]


def transposed(program: Program, x: Tensor, order: Sequence[int]) -> Tensor:
    """A tensor in memory with its axes in this order."""
    shape = tuple(x.shape[axis] for axis in order)
    moved = [axis for axis in order if x.shape[axis] != 1]
    if moved == sorted(moved):
        return x.seen_as(shape)
    out, steps, indices = program.new(x.kind, shape), strides(x.shape), indices_of(shape)
    source = offset([steps[axis] for axis in order], indices)
    target = offset(strides(shape), indices)
    program.emit(nest(shape, f"{out.name}[{target}] = {x.name}[{source}];"), out, x)
    return out


def translate_expand(program: Program, node: Node) -> list[Tensor]:
    """A tensor repeated along axes of size 1."""
    x = node.input(0)
    shape = broadcast([x.shape, tuple(node.input(1).numbers("the shape of Expand"))])
    return [x if x.shape == shape else program.computed(x.kind, shape, "{0}", [program.stored(x)])]


def translate_shaping(program: Program, node: Node) -> list[Tensor]:
    """The same elements in another shape."""
    x = program.stored(node.input(0))
    if node.kind == "Reshape":
        wanted = node.input(1).numbers("the shape of Reshape")
        keeps = not int(node.attributes.get("allowzero", 0))
        shape = [x.shape[k] if not size and keeps else size for k, size in enumerate(wanted)]
        if -1 in shape:
            shape[shape.index(-1)] = x.count // max(-prod(shape), 1)
        return [x.seen_as(tuple(shape))]
    listed = node.numbers(1, "axes") or []
    rank = x.rank + len(listed)
    axes, own = {axis % rank for axis in listed}, iter(x.shape)
    return [x.seen_as(tuple(1 if k in axes else next(own) for k in range(rank)))]


def translate_shape(program: Program, node: Node) -> list[Tensor]:
    """The sizes of a tensor."""
    first, last = int(node.attributes.get("start", 0)), node.attributes.get("end")
    sizes = node.input(0).shape[first : None if last is None else int(last)]
    return [Tensor.constant(np.asarray(sizes, np.int64))]


def _slice(program: Program, x: Tensor, axis: int, start: int, length: int) -> Tensor:
    """A block along one axis; the tensor itself where that is the whole."""
    if length == x.shape[axis]:
        return x
    shape = (*x.shape[:axis], length, *x.shape[axis + 1 :])
    if prod(x.shape[:axis]) == 1 and x.value is None:
        return x.block(start * prod(x.shape[axis + 1 :]), shape)
    out = program.new(x.kind, shape)
    if out.count:
        _copy(program, (out, 0, length), (x, start, x.shape[axis]), axis)
    return out


def _copy(
    program: Program, to: tuple[Tensor, int, int], of: tuple[Tensor, int, int], axis: int
) -> None:
    """Copy blocks along an axis; of each tensor where they begin, and its size there."""
    (out, _, _), (x, _, _) = to, of
    inner, rows = prod(out.shape[axis + 1 :]), prod(out.shape[:axis])
    block = min(to[2], of[2]) * inner
    places = [at(t, offset([1, step * inner], [str(start * inner), "i0" if rows > 1 else "0"]))
              for t, start, step in (to, of)]  # fmt: skip
    copy = f"memcpy({places[0]}, {places[1]}, {block} * sizeof({out.kind}));"
    program.emit(nest([rows], copy), out, x)


OPERATORS: dict[str, Translation] = {
    "Concat": translate_concat,
    "Split": translate_split,
    "Slice": translate_slice,
    "Gather": translate_gather,
    "Transpose": translate_transpose,
    "Expand": translate_expand,
    **dict.fromkeys(("Reshape", "Unsqueeze"), translate_shaping),
    "Identity": lambda program, node: [node.input(0)],
    "Shape": translate_shape,
}
