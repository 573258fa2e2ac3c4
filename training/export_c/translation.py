"""Nodes of an ONNX graph, with some inputs fixed, as a function of C."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from soilml.errors import ModelFileError
from training.export_c.operators import OPERATORS
from training.export_c.program import Function, Node, Program, SharedParts
from training.export_c.tensor import Tensor
from training.onnx_graph.builder import DOMAIN, OPSET, SHORTCUT, needed_nodes, without_branches

#: Local functions of a file that are templates of C; others are replaced by their nodes.
SOUND, FIRST, LIKELIEST, POSTERIOR = "SoundMemory", "FirstRound", "LikeliestSoil", "Posterior"
TEMPLATES = (SOUND, FIRST, LIKELIEST, POSTERIOR, "Quantiles")


def with_templates(model: Any) -> Any:
    """The model with those local functions alone that are templates of C."""
    from onnx import inliner

    if not model.functions:
        return model
    kept = [(DOMAIN, name) for name in TEMPLATES]
    return inliner.inline_selected_functions(model, kept, exclude=True)


def flat_nodes(graph: Any, known: dict[str, Tensor]) -> list[Any]:
    """The nodes of a graph, with each If node replaced by the branch of its constant condition.

    Of shortcuts (`Graph.either_of`) it is the branch that is right in every case.

    known: Values by name, to which the constants of the graph and of its branches are added.

    Raises `ModelFileError` for a condition that depends on the readings.
    """
    from onnx import numpy_helper

    def chosen(node: Any) -> str:
        if SHORTCUT in node.output[0]:
            return "then_branch"
        condition = known.get(node.input[0])
        if condition is None or condition.value is None:
            raise ModelFileError(
                "operator If whose condition depends on the readings is not known to export c"
            )
        return "then_branch" if condition.value.all() else "else_branch"

    nodes, constants = without_branches(graph, chosen)
    for initial in constants:
        known.setdefault(initial.name, Tensor.constant(numpy_helper.to_array(initial)))
    return nodes


def translate(
    name: str,
    nodes: Sequence[Any],
    known: Mapping[str, Tensor],
    inputs: Mapping[str, Tensor],
    outputs: Mapping[str, str],
    shared: SharedParts,
    parameters: Mapping[str, str],
    checked: bool = False,
) -> Function:
    """A function that computes some values, and writes them to places (C pointers) by name.

    Nodes whose inputs are constant are computed now, and nodes that the outputs do not need are
    left out.

    known: Constants by name.
    inputs: Values that the C function reads where they lie, or constants that take their place.
    parameters, checked: See `Function.of`.

    Raises `ModelFileError` for an operator, or a form of it, that is not known.
    """
    wanted, found = list(outputs), {**known, **inputs}
    makers = [node for node in nodes if not set(node.output) & set(inputs)]
    needed, _ = needed_nodes(makers, wanted)
    program, uses = Program(shared), Counter(n for node in needed for n in node.input)
    for node in needed:
        given = [found.get(n) for n in node.input]
        made = _translated(program, node, given)
        for key, tensor in zip(node.output, made, strict=False):
            several = tensor.text and uses[key] > 1
            found[key] = program.stored(tensor) if several else tensor
    placed = {key: (found[key], place) for key, place in outputs.items()}
    return Function.of(name, program, placed, parameters, checked)


def _translated(program: Program, node: Any, inputs: list[Tensor | None]) -> list[Tensor]:
    from onnx import helper, numpy_helper

    constant = all(t is None or t.value is not None for t in inputs)
    if node.op_type == "Constant" or (node.op_type in OPERATORS and constant and not node.domain):
        return _computed_now(node, inputs)
    if node.op_type not in OPERATORS:
        raise ModelFileError(f"operator {node.op_type} is not known to export c")
    attributes = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    if "value" in attributes:
        attributes["value"] = numpy_helper.to_array(attributes["value"])
    made = ", ".join(name for name in node.output if name)
    program.begin(f"{made} = {node.op_type}({', '.join(node.input)})")
    translated = Node(node.op_type, tuple(inputs), attributes, len(node.output))
    return OPERATORS[node.op_type](program, translated)


def _computed_now(node: Any, inputs: list[Tensor | None]) -> list[Tensor]:
    """Outputs of a node whose inputs are constant, by ONNX's reference implementation."""
    from onnx import helper
    from onnx.reference import ReferenceEvaluator

    values = {
        name: tensor.value
        for name, tensor in zip(node.input, inputs, strict=True)
        if tensor is not None and tensor.value is not None
    }
    # indices, which are int in C, have 64 bits in a graph
    values = {n: v.astype(np.int64) if v.dtype == np.int32 else v for n, v in values.items()}
    infos = [
        helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(v.dtype), v.shape)
        for name, v in values.items()
    ]
    outputs = [name for name in node.output if name]
    ends = [helper.make_empty_tensor_value_info(name) for name in outputs]
    graph = helper.make_graph([node], "constant", infos, ends)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    found = ReferenceEvaluator(model).run(None, values)
    return [Tensor.constant(np.asarray(x)) for x in found]
