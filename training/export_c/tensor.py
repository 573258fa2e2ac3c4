"""Tensors of a graph under translation, whose sizes may depend on counts known at run time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError


@dataclass(frozen=True)
class Size:
    """A whole number, or a linear form of counts such as ``3 * rows + kept``.

    Examples
    --------
    >>> rows = Size.of("rows")
    >>> (rows * 3 + 2).c
    '(3 * rows + 2)'
    >>> (rows * 6).over(Size(3)).c
    '(2 * rows)'
    >>> (rows * 3 + 2).most({"rows": 32})
    98
    """

    constant: int  # the part that is always there
    #: counts with their factors, sorted by name; no factor is zero
    parts: tuple[tuple[str, int], ...] = ()

    @staticmethod
    def of(count: str) -> Size:
        """The size that is one count."""
        return Size(0, ((count, 1),))

    @property
    def fixed(self) -> bool:
        """Whether no count takes part."""
        return not self.parts

    def __add__(self, other: Size | int) -> Size:
        other = Size(other) if isinstance(other, int) else other
        total = dict(self.parts)
        for name, factor in other.parts:
            total[name] = total.get(name, 0) + factor
        kept = tuple(sorted((name, factor) for name, factor in total.items() if factor))
        return Size(self.constant + other.constant, kept)

    def __mul__(self, other: Size | int) -> Size:
        other = Size(other) if isinstance(other, int) else other
        if not self.fixed and not other.fixed:
            raise ModelFileError(
                f"the graph has a tensor of two variable dimensions, {self.c} and {other.c}; "
                "export-c needs graphs with one"
            )
        form, factor = (self, other.constant) if other.fixed else (other, self.constant)
        parts = tuple((name, own * factor) for name, own in form.parts if factor)
        return Size(form.constant * factor, parts)

    def over(self, other: Size) -> Size:
        """The exact quotient; raises `ModelFileError` where there is none."""
        if other.fixed and other.constant:
            numbers = (self.constant, *(factor for _, factor in self.parts))
            if all(number % other.constant == 0 for number in numbers):
                parts = tuple((name, factor // other.constant) for name, factor in self.parts)
                return Size(self.constant // other.constant, parts)
        if self == other:
            return Size(1)
        raise ModelFileError(f"a tensor of {self.c} numbers cannot be reshaped by {other.c}")

    def most(self, bounds: Mapping[str, int]) -> int:
        """The largest value, from the largest value of each count."""
        return self.constant + sum(factor * bounds[name] for name, factor in self.parts)

    @property
    def c(self) -> str:
        """The size as a C expression."""
        terms = [name if factor == 1 else f"{factor} * {name}" for name, factor in self.parts]
        terms += [str(self.constant)] if self.constant or not terms else []
        text = " + ".join(terms)
        return f"({text})" if len(terms) > 1 or "*" in text else text


Shape = tuple[Size, ...]


def shape_of(numbers: Iterable[int]) -> Shape:
    """A shape whose sizes are all fixed."""
    return tuple(Size(int(number)) for number in numbers)


def total(shape: Shape) -> Size:
    """The number of elements of a tensor."""
    fixed = Size(prod(size.constant for size in shape if size.fixed))
    for size in shape:
        fixed = fixed if size.fixed else fixed * size
    return fixed


def broadcast(shapes: Iterable[Shape]) -> Shape:
    """The shape that these shapes have together; raises `ModelFileError` where there is none."""
    many = list(shapes)
    length = max(len(shape) for shape in many)
    padded = [(Size(1),) * (length - len(shape)) + shape for shape in many]
    result = []
    for sizes in zip(*padded, strict=True):
        others = {size for size in sizes if size != Size(1)}
        if len(others) > 1:
            named = " and ".join(sorted(size.c for size in others))
            raise ModelFileError(f"sizes {named} of an operator's inputs do not fit together")
        result.append(others.pop() if others else Size(1))
    return tuple(result)


def strides(shape: Shape) -> list[Size]:
    """Distance in memory between neighbours along each axis."""
    steps = [Size(1)] * len(shape)
    for axis in range(len(shape) - 2, -1, -1):
        steps[axis] = steps[axis + 1] * shape[axis + 1]
    return steps


#: C types by ONNX's numbers of element types (onnx.TensorProto.DataType). Whole numbers of 64 bits
#: are only used as indices and shapes, which fit an int.
KINDS = {1: "float", 11: "double", 6: "int", 7: "int", 9: "bool"}


def kind_of(element_type: int, name: str) -> str:
    """The C type of an ONNX element type; raises `ModelFileError` for another."""
    if element_type not in KINDS:
        raise ModelFileError(
            f"tensor {name} has ONNX element type {element_type}; export-c knows float32, "
            "float64, int32, int64 and bool"
        )
    return KINDS[element_type]


def kind_of_array(values: NDArray[Any], name: str) -> str:
    """The C type of the elements of an array."""
    kinds = {"float32": "float", "float64": "double", "int32": "int", "int64": "int"}
    kind = (kinds | {"bool": "bool"}).get(values.dtype.name)
    if kind is None:
        raise ModelFileError(f"constant {name} has elements of type {values.dtype.name}")
    return kind


@dataclass(frozen=True)
class Expression:
    """A computation of one element from elements of other tensors."""

    text: str  # a C expression in which ``{0}``, ``{1}``, ... stand for the operands
    #: all broadcast to the shape of the tensor that the expression belongs to
    operands: tuple[Tensor, ...]


@dataclass(frozen=True, eq=False)
class Tensor:
    """A tensor: a constant, an input, a part of the working memory, or an expression."""

    #: C expression of the pointer to its first element; tensors with the same elements in
    #: another shape share it
    name: str
    kind: str  # C type of the elements
    shape: Shape  # its sizes
    value: NDArray[Any] | None = None  # elements of a constant
    #: elements of a vector of whole numbers that are sizes of other tensors
    sizes: tuple[Size, ...] | None = None
    #: how an element follows from others, where the tensor has no memory of its own
    expression: Expression | None = None
    #: for a block of consecutive elements: name of the tensor in whose memory it lies, and
    #: where
    block_of: tuple[str, Size] | None = None
    #: an expression in another shape, of which this tensor has the same elements
    source: Tensor | None = None

    @staticmethod
    def constant(values: NDArray[Any], name: str) -> Tensor:
        """A constant."""
        kind = kind_of_array(values, name)
        return Tensor(name, kind, shape_of(values.shape), np.ascontiguousarray(values))

    @property
    def count(self) -> Size:
        """Number of elements."""
        return total(self.shape)

    @property
    def rank(self) -> int:
        """Number of dimensions."""
        return len(self.shape)

    def seen_as(self, shape: Shape) -> Tensor:
        """The same elements in another shape."""
        value = self.value
        if value is not None:
            value = value.reshape([size.constant for size in shape])
        return replace(self, shape=shape, value=value)

    @property
    def pending(self) -> bool:
        """Whether the elements are still to be computed."""
        return self.expression is not None or self.source is not None

    @property
    def owner(self) -> str:
        """Name of the memory in which the elements lie."""
        return self.block_of[0] if self.block_of else self.name

    def block(self, start: Size, shape: Shape) -> Tensor:
        """Consecutive elements of a tensor in memory, in a shape."""
        first = self.block_of[1] + start if self.block_of else start
        name = self.owner if first == Size(0) else f"({self.owner} + {first.c})"
        return replace(self, name=name, shape=shape, block_of=(self.owner, first))

    def numbers(self, what: str) -> list[int]:
        """Elements of a constant of whole numbers; raises `ModelFileError` for another tensor."""
        if self.value is not None:
            return [int(x) for x in self.value.reshape(-1)]
        raise ModelFileError(f"{what} depends on the readings; export-c needs it to be constant")

    def as_sizes(self, what: str) -> tuple[Size, ...]:
        """Elements that are sizes: of a constant, or from the shape of a tensor."""
        return self.sizes if self.sizes is not None else shape_of(self.numbers(what))
