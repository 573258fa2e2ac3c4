"""Values of a graph under construction, with the operators of numpy.

`a + b`, `a @ b` or `exp(a)` appends one ONNX node and returns its output. Numbers and arrays on
either side of an operator become constants of the value's own floating-point type. Nodes and
constants are numbered in the order in which Python evaluates the expression, so the order of
evaluation fixes the bytes of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import BOOL, FLOAT, Graph

#: ONNX's numbers of element types (onnx.TensorProto.DataType).
_ELEMENT_TYPES: dict[type, int] = {np.float32: FLOAT, np.int32: 6, np.bool_: BOOL, np.float64: 11}


@dataclass(frozen=True, eq=False)
class Value:
    """A tensor of a graph: the name of an input, a constant or a node's output.

    Examples
    --------
    >>> from training.onnx_graph.builder import BOOL, FLOAT, Graph
    >>> graph = Graph()
    >>> x = Value(graph, "x")
    >>> (2.0 * exp(-x) + 1.0).name
    'v3'
    """

    graph: Graph  # the graph to which operators append their nodes
    name: str  # name of the tensor in the graph
    #: numpy.float32 or numpy.float64: the type of constants that it is combined with
    dtype: type = np.float32

    __array_ufunc__ = None  # numpy leaves `array + value` to the operators below

    def __add__(self, other: Operand) -> Value:
        return self._binary("Add", self, other)

    def __radd__(self, other: Operand) -> Value:
        return self._binary("Add", other, self)

    def __sub__(self, other: Operand) -> Value:
        return self._binary("Sub", self, other)

    def __rsub__(self, other: Operand) -> Value:
        return self._binary("Sub", other, self)

    def __mul__(self, other: Operand) -> Value:
        return self._binary("Mul", self, other)

    def __rmul__(self, other: Operand) -> Value:
        return self._binary("Mul", other, self)

    def __truediv__(self, other: Operand) -> Value:
        return self._binary("Div", self, other)

    def __rtruediv__(self, other: Operand) -> Value:
        return self._binary("Div", other, self)

    def __matmul__(self, other: Operand) -> Value:
        return self._binary("MatMul", self, other)

    def __rmatmul__(self, other: Operand) -> Value:
        return self._binary("MatMul", other, self)

    def __neg__(self) -> Value:
        return self.node("Neg")

    def __lt__(self, other: Operand) -> Value:  # type: ignore[misc]
        return self._binary("Less", self, other)

    def __le__(self, other: Operand) -> Value:  # type: ignore[misc]
        return self._binary("LessOrEqual", self, other)

    def __gt__(self, other: Operand) -> Value:  # type: ignore[misc]
        return self._binary("Greater", self, other)

    def __ge__(self, other: Operand) -> Value:  # type: ignore[misc]
        return self._binary("GreaterOrEqual", self, other)

    def __and__(self, other: Value) -> Value:
        return self.node("And", other)

    def __or__(self, other: Value) -> Value:
        return self.node("Or", other)

    def __invert__(self) -> Value:
        return self.node("Not")

    def node(self, kind: str, *others: Operand, **attributes: Any) -> Value:
        """The output of one node whose first input is this value."""
        inputs = [self.operand(other).name for other in others]
        return self._output(self.graph.op(kind, self.name, *inputs, **attributes))

    def operand(self, other: Operand) -> Value:
        """A value as it is; a number or an array as a constant of this value's type."""
        return other if isinstance(other, Value) else constant(self.graph, other, self.dtype)

    def indices(self, numbers: Sequence[Any] | NDArray[Any]) -> Value:
        """A constant of whole numbers (int64), as ONNX takes indices, axes and shapes."""
        return self._output(self.graph.constant(np.asarray(numbers, dtype=np.int64)))

    def astype(self, dtype: type) -> Value:
        """The value cast to another element type."""
        name = self.graph.op("Cast", self.name, to=_ELEMENT_TYPES[dtype])
        floating = dtype if dtype in (np.float32, np.float64) else self.dtype
        return Value(self.graph, name, floating)

    def reshape(self, *shape: int) -> Value:
        """The value in a new shape; 0 keeps a dimension, one -1 is computed."""
        return self.node("Reshape", self.indices(shape))

    def take(self, indices: Sequence[int], axis: int) -> Value:
        """The entries at these indices along an axis, as `numpy.take`."""
        return self.node("Gather", self.indices(indices), axis=axis)

    def split(self, parts: int | Sequence[int], axis: int) -> list[Value]:
        """Consecutive parts along an axis: so many of equal size, or of these sizes."""
        if isinstance(parts, int):
            names = self.graph.ops("Split", parts, self.name, axis=axis, num_outputs=parts)
        else:
            sizes = self.indices(parts)
            names = self.graph.ops("Split", len(parts), self.name, sizes.name, axis=axis)
        return [self._output(name) for name in names]

    def columns(self, first: int, last: int) -> Value:
        """Columns `first` to `last` (excluded) of a matrix."""
        return self.node("Slice", *(self.indices([k]) for k in (first, last, 1)))

    def last_columns(self, *sizes: int) -> list[Value]:
        """The last columns of a matrix, in parts of these sizes, after all columns before them."""
        starts = [sum(sizes[k:]) for k in range(len(sizes))]
        ends = [self.indices([-start]) for start in starts]
        ends = [self.indices([0]), *ends, self.indices([np.iinfo(np.int64).max])]
        axis = self.indices([-1])
        return [self.node("Slice", first, last, axis) for first, last in pairwise(ends)]

    def largest(self, count: int, axis: int) -> Value:
        """The largest entries along an axis, in descending order."""
        values, _ = self.graph.ops("TopK", 2, self.name, self.indices([count]).name, axis=axis)
        return self._output(values)

    def clip(self, lower: Operand, upper: Operand | None = None) -> Value:
        """The value limited to an interval, which may have no upper end."""
        return self.node("Clip", *([lower] if upper is None else [lower, upper]))

    def sum(self, axis: int | None = None, keepdims: bool | None = None) -> Value:
        """The sum over one axis or all; see `reduce`."""
        return self.reduce("ReduceSum", axis, keepdims)

    def sum_of_squares(self, axis: int | None = None, keepdims: bool | None = None) -> Value:
        """The sum of squares over one axis or all; see `reduce`."""
        return self.reduce("ReduceSumSquare", axis, keepdims)

    def mean(self, axis: int | None = None, keepdims: bool | None = None) -> Value:
        """The mean over one axis or all; see `reduce`."""
        return self.reduce("ReduceMean", axis, keepdims)

    def max(self, axis: int | None = None, keepdims: bool | None = None) -> Value:
        """The largest along one axis or all; see `reduce`."""
        return self.reduce("ReduceMax", axis, keepdims)

    def min(self, axis: int) -> Value:
        """The least along one axis, which is left out."""
        return self.reduce("ReduceMin", axis, False)

    def reduce(self, kind: str, axis: int | None = None, keepdims: bool | None = None) -> Value:
        """A reduction over one axis or all.

        Without `keepdims` the attribute is not written, and ONNX keeps all dimensions.
        """
        axes = [] if axis is None else [self.indices([axis])]
        return self.node(kind, *axes, **({} if keepdims is None else {"keepdims": int(keepdims)}))

    def named(self, name: str) -> Value:
        """The value under the name of a graph output; only for the output of the last node."""
        self.graph.rename_last(self.name, name)
        return self._output(name)

    def _binary(self, kind: str, left: Operand, right: Operand) -> Value:
        if kind in ("Mul", "Div") and isinstance(right, float) and right == 1.0:
            return self
        first, second = self.operand(left), self.operand(right)
        return self._output(self.graph.op(kind, first.name, second.name))

    def _output(self, name: str) -> Value:
        return Value(self.graph, name, self.dtype)


Operand = Value | float | NDArray[Any]  # What stands on either side of an operator


def constant(graph: Graph, value: Any, dtype: type = np.float32, name: str = "") -> Value:
    """A constant number or array of a floating-point type; a name that is given is kept."""
    array: NDArray[Any] = np.asarray(value, dtype=dtype)
    return Value(graph, graph.constant(array, exact=True, name=name), dtype)


#: A value of a graph, or an array: functions of these serve both, and a formula is written once.
Tensor = TypeVar("Tensor", Value, NDArray[Any])


class _Elementwise(Protocol):
    def __call__(self, x: Tensor, /) -> Tensor: ...


def _function(kind: str, of_array: Callable[[Any], Any]) -> _Elementwise:
    """A function of each element, as one node."""
    return cast(_Elementwise, lambda x: x.node(kind) if isinstance(x, Value) else of_array(x))


#: Functions of one tensor, element by element, named as in numpy.
exp, log, sqrt = _function("Exp", np.exp), _function("Log", np.log), _function("Sqrt", np.sqrt)
tanh, asinh = _function("Tanh", np.tanh), _function("Asinh", np.arcsinh)
absolute, floor = _function("Abs", np.abs), _function("Floor", np.floor)


def squared_distances(x: Tensor, centres: NDArray[Any]) -> Tensor:
    """Squared distances (n, m) from rows (n, d) to centres (m, d), never below zero."""
    total: Any = x @ (-2.0 * centres.T) + (x * x).sum(axis=1, keepdims=True)
    return cast(Tensor, maximum(total + (centres**2).sum(axis=1), 0.0))


def softmax(x: Value, axis: int) -> Value:
    """`exp(x)` over its sum along an axis, computed without overflow."""
    return x.node("Softmax", axis=axis)


def maximum(x: Tensor, other: Any) -> Tensor:
    """The larger of two tensors, element by element."""
    return x.node("Max", other) if isinstance(x, Value) else np.asarray(np.maximum(x, other))


def minimum(x: Tensor, other: Any) -> Tensor:
    """The smaller of two tensors, element by element."""
    return x.node("Min", other) if isinstance(x, Value) else np.asarray(np.minimum(x, other))


def where(condition: Value, x: Value, otherwise: Operand) -> Value:
    """`x` where the condition is true, else the other value, element by element."""
    inputs = (condition.name, x.name, x.operand(otherwise).name)
    return Value(x.graph, x.graph.op("Where", *inputs), x.dtype)


def concat(values: Sequence[Tensor], axis: int) -> Tensor:
    """Tensors one after another along an axis."""
    first = values[0]
    if not isinstance(first, Value):
        return np.concatenate(values, axis=axis)
    name = first.graph.op("Concat", *[value.name for value in values], axis=axis)
    return Value(first.graph, name, first.dtype)


def composite(
    name: str,
    outputs: Sequence[str],
    body: Callable[..., Sequence[Value]],
    **given: Value,
) -> list[Value]:
    """Results of a local function of the model (`Graph.composite`), whose body takes the values."""
    graph = next(iter(given.values())).graph

    def add_to(inner: Graph) -> Sequence[str]:
        made = body(**{key: Value(inner, key, value.dtype) for key, value in given.items()})
        return [value.name for value in made]

    names = {key: value.name for key, value in given.items()}
    return [Value(graph, one) for one in graph.composite(name, names, outputs, add_to)]


def either_of(
    condition: Value, first: Callable[[], Sequence[Value]], other: Callable[[], Sequence[Value]]
) -> list[Value]:
    """Results of the first body where the condition (1,) is true, else of the other, in less time.

    See `Graph.either_of`.
    """
    graph = condition.graph
    bodies = [lambda body=body: [value.name for value in body()] for body in (first, other)]
    return [Value(graph, one) for one in graph.either_of(condition.name, bodies)]


def affine(x: Tensor, weights: NDArray[Any], bias: NDArray[Any]) -> Tensor:
    """`x weights + bias`."""
    return gemm(x, weights, bias) if isinstance(x, Value) else np.asarray(x @ weights + bias)


def one_column(x: Tensor, k: int) -> Tensor:
    """Column k of a matrix, (n, 1)."""
    return x.columns(k, k + 1) if isinstance(x, Value) else x[:, k : k + 1]


def any_of_row(x: Tensor) -> Tensor:
    """Whether anything in a row of a matrix of truth values is true, (n,)."""
    if not isinstance(x, Value):
        return np.asarray(x.any(axis=1))
    return x.astype(np.float64).reduce("ReduceMax", 1, False) > 0.5


def halves(x: Tensor) -> list[Tensor]:
    """Both halves of the columns of a matrix."""
    return x.split(2, axis=1) if isinstance(x, Value) else np.split(x, 2, axis=1)


def gemm(
    a: Value,
    b: Operand,
    c: Operand | None = None,
    *,
    transpose_a: bool = False,
    transpose_b: bool = False,
    alpha: float = 1.0,
) -> Value:
    """`alpha a b + c` of matrices as one node, with a or b transposed."""
    attributes: dict[str, Any] = {}
    if alpha != 1.0:
        attributes["alpha"] = alpha
    if transpose_a:
        attributes["transA"] = 1
    if transpose_b:
        attributes["transB"] = 1
    return a.node("Gemm", *([b] if c is None else [b, c]), **attributes)


def cholesky_columns(matrix: Value, count: int) -> Value:
    r"""The first columns of the lower Cholesky factor of a positive definite matrix.

    .. math:: l_k = \frac{M^{(k)} e_k}{\sqrt{M^{(k)}_{kk}}}, \qquad M^{(k+1)} = M^{(k)} - l_k l_k^T

    matrix: Second moments (p, p) of points whose first coordinate is 1, so that its first entry is
        1, and the first column needs no square root. That column of the factor is the mean of the
        points, and the other columns are the Cholesky factor of their covariance.
    count: Number of columns.

    Returns: The columns (p, count).

    References: Golub and Van Loan, Matrix Computations, section 4.2 (outer-product form).
    """
    columns = []
    for k in range(count):
        index = matrix.indices([k])
        column = matrix.node("Gather", index, axis=1)
        if k:
            column = column / sqrt(column.node("Gather", index, axis=0))
        columns.append(column)
        if k < count - 1:
            matrix = gemm(column, column, matrix, alpha=-1.0, transpose_b=True)
    return concat(columns, axis=1)
