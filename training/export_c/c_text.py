"""Numbers, arrays and loops over the elements of tensors as C text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.export_c.tensor import Expression, Shape, Size, Tensor, strides

WIDTH = 100  # Width of the lines that hold the numbers of an array
LEAST_BLOCK = 4  # Elements of a row that is copied as a block of memory
LONG = 16  # Elements of a loop that stays one of a fixed length
LARGEST_INT = 2**31 - 1  # The largest whole number that every C compiler's int holds (32 bits)


def number(value: Any, kind: str) -> str:
    """One number of an element type (`float`, `double`, `int`, `bool`) as a C literal.

    Floating-point numbers are written with the digits that give back every bit.

    Examples
    --------
    >>> number(0.1, "float"), number(2, "double"), number(True, "bool")
    ('0.1f', '2.0', 'true')
    """
    if kind == "bool":
        return "true" if value else "false"
    if kind == "int":
        return str(int(np.clip(int(value), -LARGEST_INT, LARGEST_INT)))
    single = kind == "float"
    x = float(np.float32(value)) if single else float(value)
    if np.isnan(x):
        return "NAN" if single else "(double)NAN"
    if np.isinf(x):
        text = "INFINITY" if single else "(double)INFINITY"
        return text if x > 0 else f"-{text}"
    text = str(np.float32(value)) if single else repr(x)
    if not any(mark in text for mark in ".e"):
        text += ".0"
    return text + ("f" if single else "")


def array(name: str, values: NDArray[Any], kind: str) -> str:
    """The definition of a constant array."""
    numbers = ", ".join(number(value, kind) for value in values.reshape(-1))
    lines = textwrap.wrap(numbers, WIDTH - 4, break_on_hyphens=False, break_long_words=False)
    inside = "\n".join(f"    {line}" for line in lines)
    return f"static const {kind} {name}[{values.size}] = {{\n{inside}\n}};"


INDENT = "    "


def offset(steps: Sequence[Size], indices: Sequence[str]) -> str:
    """The place of an element in memory, from its indices and the steps along the axes."""
    terms = [
        index if step == Size(1) else f"{index} * {step.c}"
        for step, index in zip(steps, indices, strict=True)
        if step != Size(0) and index != "0"
    ]
    return " + ".join(terms) or "0"


def nest(sizes: Sequence[Size], indices: Sequence[str], body: str) -> str:
    """Loops, one in another, around a statement; sizes of 1 need none."""
    lines, depth = [], 1
    for size, index in zip(sizes, indices, strict=True):
        if size != Size(1):
            lines.append(f"{INDENT * depth}for (int {index} = 0; {index} < {size.c}; ++{index})")
            depth += 1
    lines += [INDENT * depth + line for line in body.splitlines()]
    return "\n".join(lines)


def copied_rows(
    out: Tensor, to: tuple[str, Size], x: Tensor, source: tuple[str, Size], sizes: Sequence[Size]
) -> str:
    """Copies of rows, so many of so many elements; of each tensor where they begin, and the step.

    Rows of a fixed length are copied as a block of memory, which compilers do side by side.
    """
    i, j = indices_of(sizes)
    block = sizes[1].fixed and sizes[1].constant >= LEAST_BLOCK
    one, other = (
        offset([Size(1), step, Size(1)], [start, i, "0" if block else j])
        for start, step in (to, source)
    )
    if not block:
        return nest(sizes, [i, j], f"{out.name}[{one}] = {x.name}[{other}];")
    into, of = (
        tensor.name + (f" + {place}" if place != "0" else "")
        for tensor, place in ((out, one), (x, other))
    )
    copy = f"memcpy({into}, {of}, {sizes[1].constant} * sizeof({out.kind}));"
    return nest(sizes[:1], [i], copy)


def indices_of(sizes: Sequence[Size], first: int = 0) -> list[str]:
    """Names of loop variables; `0` for sizes of 1, which have no loop."""
    return ["0" if size == Size(1) else f"i{first + k}" for k, size in enumerate(sizes)]


def element_loops(out: str, shape: Shape, expression: Expression) -> str:
    """Loops that compute every element of a tensor, with axes merged where memory allows."""
    leaves = leaves_of(expression)
    steps = [_broadcast_steps(leaf.shape, shape) for leaf in leaves]
    sizes, merged = _merge(list(shape), [*steps, strides(shape)])
    indices = indices_of(sizes)
    places = {
        leaf: f"{leaf.name}[{offset(own, indices)}]"
        for leaf, own in zip(leaves, merged, strict=False)
    }
    target = f"{out}[{offset(merged[-1], indices)}]"
    return nest(sizes, indices, f"{target} = {_text(expression, places)};")


def element(shape: Shape, expression: Expression, indices: Sequence[str]) -> str:
    """The element of an expression of this shape at some indices."""
    places = {
        leaf: f"{leaf.name}[{offset(_broadcast_steps(leaf.shape, shape), indices)}]"
        for leaf in leaves_of(expression)
    }
    return _text(expression, places)


def leaves_of(expression: Expression) -> list[Tensor]:
    """The tensors in memory that an expression reads, each once; single constants are literals."""
    found: dict[Tensor, None] = {}
    for operand in expression.operands:
        if operand.expression is not None:
            found |= dict.fromkeys(leaves_of(operand.expression))
        elif not is_literal(operand):
            found[operand] = None
    return list(found)


def is_literal(tensor: Tensor) -> bool:
    """Whether the tensor is a constant of one element, which is written in place."""
    return tensor.value is not None and tensor.value.size == 1


def _text(expression: Expression, places: dict[Tensor, str]) -> str:
    parts = []
    for operand in expression.operands:
        if operand.expression is not None:
            parts.append(f"({_text(operand.expression, places)})")
        elif is_literal(operand):
            assert operand.value is not None
            parts.append(number(operand.value.reshape(-1)[0], operand.kind))
        else:
            parts.append(places[operand])
    return expression.text.format(*parts)


def _broadcast_steps(own: Shape, shape: Shape) -> list[Size]:
    """Steps of a tensor along the axes of the shape that it is broadcast to."""
    padded = (Size(1),) * (len(shape) - len(own)) + own
    return [
        Size(0) if size == Size(1) else step
        for size, step in zip(padded, strides(padded), strict=True)
    ]


def _merge(sizes: list[Size], steps: list[list[Size]]) -> tuple[list[Size], list[list[Size]]]:
    """Sizes and steps with neighbouring axes as one where every tensor is contiguous in them."""
    kept = [axis for axis, size in enumerate(sizes) if size != Size(1)]
    sizes = [sizes[axis] for axis in kept]
    steps = [[own[axis] for axis in kept] for own in steps]
    for axis in range(len(sizes) - 1, 0, -1):
        both_variable = not sizes[axis].fixed and not sizes[axis - 1].fixed
        # loops of a fixed number of elements are computed side by side by compilers
        long = sizes[axis].fixed and sizes[axis].constant >= LONG and not sizes[axis - 1].fixed
        if (
            not both_variable
            and not long
            and all(own[axis - 1] == own[axis] * sizes[axis] for own in steps)
        ):
            sizes[axis - 1] = sizes[axis - 1] * sizes[axis]
            del sizes[axis]
            for own in steps:
                own[axis - 1] = own[axis]
                del own[axis]
    return sizes, steps
