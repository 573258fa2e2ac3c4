"""A model file's set posterior as a graph of fixed shapes, for one step of a stream."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.onboard.set_contract import (
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    ROW_IN_RANGE,
    SET_OUTPUTS,
    SET_PREFIX,
    SET_SWITCH,
)
from training.onnx_graph.builder import OPSET, needed_nodes, without_branches

ZERO, COLUMN_AXIS = "step_zero", "step_column_axis"  # Names of constants of the graph


def one_step_graph(model: Any, name: str, rows: int) -> Any:
    """A graph that adds `rows` rows to a state that is always as large as it can be.

    All shapes are numbers, there is no branch, and the state has as many rows as columns: it
    begins as zeros, and after each step the caller replaces the outgoing state by its triangular
    factor.

    model: An `onnx.ModelProto` with a set posterior.
    name: The model file, for messages.
    rows: Rows of one step.

    Raises `InputError` for a file without a set posterior, or one whose shapes depend on more than
    rows and state.
    """
    import onnx
    import onnx.inliner

    model = onnx.inliner.inline_local_functions(model)
    graph = model.graph
    given = {value.name for value in graph.input}
    if not {*MEMORY_INPUTS} <= given:
        raise InputError(f"{name} has no set posterior: each of its answers is from one row")
    nodes, initializers = without_branches(graph, lambda node: "then_branch")  # of sets
    wanted = [*(SET_PREFIX + one for one in (*SET_OUTPUTS, "abstains", "at_edge"))]
    wanted += [*MEMORY_OUTPUTS, ROW_IN_RANGE]
    columns = next(v for v in graph.input if v.name == MEMORY_INPUTS[0])
    size = _dims(columns)[1].dim_value
    sizes = {"rows": rows, "kept": size}
    inputs = [_sized(value, sizes) for value in graph.input if value.name != SET_SWITCH]
    shapes = {value.name: [d.dim_value for d in _dims(value)] for value in inputs}
    initializers = [
        _default(one, shapes.get(one.name)) for one in initializers if one.name not in MEMORY_INPUTS
    ]
    outputs = [
        onnx.helper.make_tensor_value_info(value.name, value.type.tensor_type.elem_type, None)
        for value in graph.output
        if value.name in wanted
    ]
    nodes = [part for node in nodes for part in _without_compress(node)]
    initializers += [
        onnx.numpy_helper.from_array(np.zeros((), np.float32), ZERO),
        onnx.numpy_helper.from_array(np.ones(1, np.int64), COLUMN_AXIS),
    ]
    found = onnx.helper.make_graph(nodes, graph.name, inputs, outputs, initializers)
    fixed = onnx.helper.make_model(
        found, opset_imports=[onnx.helper.make_opsetid("", OPSET)], ir_version=model.ir_version
    )
    fixed = onnx.shape_inference.infer_shapes(_pruned(fixed), strict_mode=True, data_prop=True)
    open_ended = [value.name for value in fixed.graph.output if not _is_static(value)]
    if open_ended:
        raise InputError(f"{name}: the shape of {', '.join(open_ended)} does not follow from rows")
    del fixed.graph.value_info[:]
    return fixed


def _without_compress(node: Any) -> list[Any]:
    """Rows that are not selected are zeros instead of left out: they add nothing to a system."""
    import onnx

    if node.op_type != "Compress":
        return [node]
    rows, selected = node.input
    mask = f"{node.output[0]}_selected"
    return [
        onnx.helper.make_node("Unsqueeze", [selected, COLUMN_AXIS], [mask], name=f"{node.name}_m"),
        onnx.helper.make_node("Where", [mask, rows, ZERO], node.output, name=node.name),
    ]


def _sized(value: Any, sizes: dict[str, int]) -> Any:
    """An input with numbers in the place of named dimensions."""
    import onnx

    shape = [sizes[d.dim_param] if d.dim_param else d.dim_value for d in _dims(value)]
    return onnx.helper.make_tensor_value_info(value.name, value.type.tensor_type.elem_type, shape)


def _dims(value: Any) -> Any:
    return value.type.tensor_type.shape.dim


def _default(constant: Any, shape: list[int] | None) -> Any:
    """A constant; the default of an input is repeated to its shape."""
    import onnx

    if shape is None or list(constant.dims) == shape:
        return constant
    value = np.broadcast_to(onnx.numpy_helper.to_array(constant), shape)
    return onnx.numpy_helper.from_array(np.ascontiguousarray(value), constant.name)


def _pruned(model: Any) -> Any:
    """The model without nodes and constants that no output needs."""
    graph = model.graph
    kept, needed = needed_nodes(graph.node, [value.name for value in graph.output])
    constants = [one for one in graph.initializer if one.name in needed]
    del graph.node[:], graph.initializer[:]
    graph.node.extend(kept)
    graph.initializer.extend(constants)
    return model


def _is_static(value: Any) -> bool:
    tensor = value.type.tensor_type
    return tensor.HasField("shape") and all(d.HasField("dim_value") for d in tensor.shape.dim)
