"""A small builder of ONNX graphs: names in, names out, float64 inside.

The operator set and file version are pinned low enough for every onnxruntime since 1.14; onnx's own
defaults are newer than the runtime reads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

OPSET = 18
IR_VERSION = 9


class Graph:
    """Nodes and constants of a graph under construction; values are addressed by name."""

    def __init__(self) -> None:
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def constant(self, value: Any) -> str:
        """A constant array; numbers become float64."""
        from onnx import numpy_helper

        array = np.asarray(value)
        if array.dtype.kind == "f":
            array = array.astype(np.float64)
        name = f"c{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def op(self, kind: str, *inputs: str, out: str | None = None, **attributes: Any) -> str:
        """One node with one output; its name."""
        from onnx import helper

        name = out or f"v{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def double(self, name: str) -> str:
        """As float64."""
        return self.op("Cast", name, to=11)

    def single(self, name: str, out: str) -> str:
        """As float32, under the name of an output."""
        return self.op("Cast", name, out=out, to=1)

    def scaled(self, x: str, mean: Floats, scale: Floats) -> str:
        """`(x - mean) / scale`."""
        return self.op("Div", self.op("Sub", x, self.constant(mean)), self.constant(scale))

    def affine(self, x: str, weights: Any, bias: Any) -> str:
        """`x @ weights + bias`."""
        return self.op("Gemm", x, self.constant(weights), self.constant(bias))

    def columns(self, x: str, first: int, last: int) -> str:
        """Columns `first` to `last` (excluded)."""
        ends = [self.constant(np.asarray([k], dtype=np.int64)) for k in (first, last, 1)]
        return self.op("Slice", x, *ends)

    def squared_distances(self, x: str, centres: Floats) -> str:
        """Squared distances (n, m) from rows to centres (m, d), never below zero."""
        own = self.op("ReduceSum", self.op("Mul", x, x), self._axis(1), keepdims=1)
        cross = self.op("MatMul", x, self.constant(-2.0 * centres.T))
        total = self.op("Add", self.op("Add", cross, own), self.constant((centres**2).sum(axis=1)))
        return self.op("Max", total, self.constant(np.float64(0.0)))

    def reduced(self, kind: str, x: str, axis: int, keep: bool = False) -> str:
        """A reduction over one axis."""
        return self.op(kind, x, self._axis(axis), keepdims=int(keep))

    def _axis(self, axis: int) -> str:
        return self.constant(np.asarray([axis], dtype=np.int64))

    def reshaped(self, x: str, *shape: int) -> str:
        """A new shape; 0 keeps a dimension, -1 fits."""
        return self.op("Reshape", x, self.constant(np.asarray(shape, dtype=np.int64)))

    def model(self, inputs: list[str], outputs: dict[str, tuple[int, list[Any]]]) -> Any:
        """The finished ONNX model: float32 inputs [rows]; outputs name -> (element type, shape)."""
        from onnx import TensorProto, checker, helper

        graph = helper.make_graph(
            self._nodes,
            "soilml",
            [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["rows"]) for n in inputs],
            [helper.make_tensor_value_info(n, k, shape) for n, (k, shape) in outputs.items()],
            self._constants,
        )
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="soilml"
        )
        model.ir_version = IR_VERSION
        checker.check_model(model, full_check=True)
        return model
