"""Tensors of a graph under translation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError

Shape = tuple[int, ...]
#: C types by ONNX's numbers of element types (onnx.TensorProto.DataType). Whole numbers of 64 bits
#: are only used as indices and shapes, which fit an int.
KINDS = {1: "float", 11: "double", 6: "int", 7: "int", 9: "bool"}
DTYPES = {"double": np.float64, "float": np.float32, "int": np.int32, "bool": np.bool_}
REAL = ("float", "double")
LARGEST_INT = 2**31 - 1  # The largest whole number that every C compiler's int holds (32 bits)


def kind_of(element_type: int, name: str) -> str:
    """The C type of an ONNX element type; raises `ModelFileError` for another."""
    if element_type not in KINDS:
        raise ModelFileError(
            f"tensor {name} has ONNX element type {element_type}; export c knows float32, "
            "float64, int32, int64 and bool"
        )
    return KINDS[element_type]


def kind_of_array(values: NDArray[Any], name: str) -> str:
    """The C type of the elements of an array."""
    from onnx import helper

    return kind_of(helper.np_dtype_to_tensor_dtype(values.dtype), name)


def broadcast(shapes: Iterable[Shape]) -> Shape:
    """The shape that these shapes have together; raises `ModelFileError` where there is none."""
    try:
        return tuple(int(size) for size in np.broadcast_shapes(*shapes))
    except ValueError as error:
        raise ModelFileError("sizes of an operator's inputs do not fit together") from error


def strides(shape: Shape) -> list[int]:
    """Distance in memory between neighbours along each axis."""
    return [prod(shape[axis + 1 :]) for axis in range(len(shape))]


@dataclass(frozen=True, eq=False)
class Tensor:
    """A tensor: a constant, an input, a part of the working memory, or an expression."""

    name: str  # C expression of the pointer to its first element
    kind: str  # C type of the elements
    shape: Shape
    value: NDArray[Any] | None = None  # elements of a constant
    #: where it has no memory: how an element follows from those of others, ``{0}``, ``{1}``, ...
    text: str = ""
    operands: tuple[Tensor, ...] = ()
    owner: str = ""  # the tensor in whose memory it lies, where that is another one

    @staticmethod
    def constant(values: NDArray[Any]) -> Tensor:
        """A constant."""
        kind = kind_of_array(values, "of the graph")
        if kind == "int":
            values = np.clip(values, -LARGEST_INT, LARGEST_INT)
        return Tensor("", kind, values.shape, np.ascontiguousarray(values.astype(DTYPES[kind])))

    @property
    def count(self) -> int:
        """Number of elements."""
        return prod(self.shape)

    @property
    def rank(self) -> int:
        """Number of dimensions."""
        return len(self.shape)

    @property
    def home(self) -> str:
        """Name of the tensor in whose memory it lies."""
        return self.owner or self.name

    def seen_as(self, shape: Shape) -> Tensor:
        """The same elements in another shape; not of an expression."""
        value = None if self.value is None else self.value.reshape(shape)
        return replace(self, shape=shape, value=value)

    def block(self, start: int, shape: Shape) -> Tensor:
        """Consecutive elements of a tensor in memory, in a shape."""
        name = f"({self.name} + {start})" if start else self.name
        return replace(self, name=name, shape=shape, owner=self.home)

    def numbers(self, what: str) -> list[int]:
        """Elements of a constant of whole numbers; raises `ModelFileError` for another tensor."""
        if self.value is not None:
            return [int(x) for x in self.value.reshape(-1)]
        raise ModelFileError(f"{what} depends on the readings; export c needs it to be constant")
