"""Tensors of a graph under translation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from training.export_c.sizes import Shape, Size, shape_of, total

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
    """A computation of one element from elements of other tensors.

    Parameters
    ----------
    text : str
        A C expression in which ``{0}``, ``{1}``, ... stand for the operands.
    operands : tuple of Tensor
        All broadcast to the shape of the tensor that the expression belongs to.
    """

    text: str
    operands: tuple[Tensor, ...]


@dataclass(frozen=True, eq=False)
class Tensor:
    """A tensor: a constant, an input, a part of the working memory, or an expression.

    Parameters
    ----------
    name : str
        C expression of the pointer to its first element; tensors with the same elements in
        another shape share it.
    kind : str
        C type of the elements.
    shape : Shape
        Its sizes.
    value : ndarray, optional
        Elements of a constant.
    sizes : tuple of Size, optional
        Elements of a vector of whole numbers that are sizes of other tensors.
    expression : Expression, optional
        How an element follows from others, where the tensor has no memory of its own.
    block_of : (str, Size), optional
        For a block of consecutive elements: name of the tensor in whose memory it lies, and where.
    source : Tensor, optional
        An expression in another shape, of which this tensor has the same elements.
    """

    name: str
    kind: str
    shape: Shape
    value: NDArray[Any] | None = None
    sizes: tuple[Size, ...] | None = None
    expression: Expression | None = None
    block_of: tuple[str, Size] | None = None
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
