"""Numbers, arrays and loops over the elements of tensors as C text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.export_c.tensor import LARGEST_INT, Shape, Tensor, strides

WIDTH = 100  # Width of the lines that hold the numbers of an array
INDENT = "    "


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


def wrapped(text: str, indent: int) -> list[str]:
    """Lines of C, those after the first indented by four more."""
    first, later = " " * indent, " " * (indent + 4)
    return textwrap.wrap(text, WIDTH, initial_indent=first, subsequent_indent=later)


def offset(steps: Sequence[int], indices: Sequence[str]) -> str:
    """The place of an element in memory, from its indices and the steps along the axes."""
    terms = [
        index if step == 1 else f"{index} * {step}"
        for step, index in zip(steps, indices, strict=True)
        if step and index != "0"
    ]
    return " + ".join(terms) or "0"


def nest(sizes: Sequence[int], body: str) -> str:
    """Loops over i0, i1, ..., one in another, around a statement; sizes of 1 need none."""
    lines, depth = [], 1
    for index, size in zip(indices_of(sizes), sizes, strict=True):
        if size != 1:
            lines.append(f"{INDENT * depth}for (int {index} = 0; {index} < {size}; ++{index})")
            depth += 1
    lines += [INDENT * depth + line for line in body.splitlines()]
    return "\n".join(lines)


def indices_of(sizes: Sequence[int]) -> list[str]:
    """Names of loop variables; `0` for sizes of 1, which have no loop."""
    return ["0" if size == 1 else f"i{k}" for k, size in enumerate(sizes)]


def at(tensor: Tensor, place: str) -> str:
    """A pointer to a place in a tensor."""
    return tensor.name if place == "0" else f"{tensor.name} + {place}"


def element_loops(out: Tensor, tensor: Tensor) -> str:
    """Loops that compute every element of a tensor, with axes merged where memory allows."""
    leaves = leaves_of(tensor)
    shape = out.shape
    steps = [*(_broadcast_steps(leaf.shape, shape) for leaf in leaves), strides(shape)]
    sizes, merged = _merge(list(shape), steps)
    indices = indices_of(sizes)
    places = {
        leaf: f"{leaf.name}[{offset(own, indices)}]"
        for leaf, own in zip(leaves, merged, strict=False)
    }
    target = f"{out.name}[{offset(merged[-1], indices)}]"
    return nest(sizes, f"{target} = {_text(tensor, places)};")


def leaves_of(tensor: Tensor) -> list[Tensor]:
    """The tensors in memory that an expression reads, each once; single constants are literals."""
    found: dict[Tensor, None] = {}
    for operand in tensor.operands:
        if operand.text:
            found |= dict.fromkeys(leaves_of(operand))
        elif not is_literal(operand):
            found[operand] = None
    return list(found)


def is_literal(tensor: Tensor) -> bool:
    """Whether the tensor is a constant of one element, which is written in place."""
    return tensor.value is not None and tensor.value.size == 1


def _text(tensor: Tensor, places: dict[Tensor, str]) -> str:
    parts = []
    for operand in tensor.operands:
        if operand.text:
            parts.append(f"({_text(operand, places)})")
        elif is_literal(operand):
            assert operand.value is not None
            parts.append(number(operand.value.reshape(-1)[0], operand.kind))
        else:
            parts.append(places[operand])
    return tensor.text.format(*parts)


def _broadcast_steps(own: Shape, shape: Shape) -> list[int]:
    """Steps of a tensor along the axes of the shape that it is broadcast to."""
    padded = (1,) * (len(shape) - len(own)) + own
    return [0 if size == 1 else step for size, step in zip(padded, strides(padded), strict=True)]


def _merge(sizes: list[int], steps: list[list[int]]) -> tuple[list[int], list[list[int]]]:
    """Sizes and steps with neighbouring axes as one where every tensor is contiguous in them."""
    kept = [axis for axis, size in enumerate(sizes) if size != 1]
    sizes = [sizes[axis] for axis in kept]
    steps = [[own[axis] for axis in kept] for own in steps]
    for axis in range(len(sizes) - 1, 0, -1):
        if all(own[axis - 1] == own[axis] * sizes[axis] for own in steps):
            sizes[axis - 1] *= sizes.pop(axis)
            for own in steps:
                own[axis - 1] = own.pop(axis)
    return sizes, steps
