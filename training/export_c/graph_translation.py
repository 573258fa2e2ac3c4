"""An ONNX graph, with some inputs fixed, as a program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from soilml.errors import ModelFileError
from soilml.onboard.set_contract import MEMORY_INPUTS, MEMORY_OUTPUTS, ROW_IN_RANGE, SET_SWITCH
from training.export_c.joined_nodes import joined
from training.export_c.operators import OPERATORS as ONNX_OPERATORS
from training.export_c.operators import solved, together
from training.export_c.operators.products import squares_of_product
from training.export_c.point_stages import PointStage, in_stages, with_late_copies
from training.export_c.program import Node, Program, SharedParts
from training.export_c.tensor import Size, Tensor
from training.onnx_graph.builder import SHORTCUT, needed_nodes

#: Operators of ONNX, and those that its nodes are joined to.
OPERATORS = ONNX_OPERATORS | together.OPERATORS | solved.OPERATORS


def translate_graph(
    model: Any,
    program: Program,
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
    in_tiles: bool = False,
) -> dict[str, Tensor]:
    """Append the computation of some outputs to a program.

    Nodes whose inputs are constant are computed now, a branch by a constant condition is chosen
    now, and nodes that the outputs do not need are left out.

    model: The model; its graph may have If nodes.
    program: Receives the statements.
    inputs: Inputs of the graph by name: constants, or tensors that the C function is given.
    outputs: Outputs that are computed.
    in_tiles: Whether points are computed a few at a time, where a graph treats them one by one.

    Raises `ModelFileError` for an operator, or a form of it, that is not known.
    """
    from onnx import numpy_helper

    known: dict[str, Tensor] = {}
    for initial in model.graph.initializer:
        known[initial.name] = Tensor.constant(numpy_helper.to_array(initial), initial.name)
    known |= inputs
    every = _with_sound_memory(_without_branches(model.graph, known))
    nodes, _ = needed_nodes(every, outputs)
    steps: Sequence[Any] = nodes
    late: frozenset[str] = frozenset()
    if in_tiles:
        nodes = steps = joined(nodes, known, outputs)
        shapes, trial = dict(known), Program(SharedParts(), program.bounds)
        tried = _Translation(trial, nodes, shapes, outputs, model.opset_import)
        tried.add_all(nodes)
        for name, product in tried.squared.items():  # only the squares of these are computed
            left, right = (shapes[given] for given in product.input)
            shapes[name] = Tensor(name, left.kind, (*left.shape[:-1], right.shape[-1]))
        nodes, late = with_late_copies(nodes, shapes, outputs)
        steps = in_stages(nodes, shapes, outputs, late)
    translation = _Translation(program, nodes, known, outputs, model.opset_import, late)
    translation.add_all(steps)
    return {name: program.stored(known[name]) for name in outputs if known[name].count != Size(0)}


#: Operators that only move elements: where they read the memory of a set, they are computed again
#: for a node so many further on, so that a copy of the memory does not take room in between.
MOVING, FAR = ("Transpose", "Split", "Concat", "Gather"), 60


class _Translation:
    """Nodes of a graph that are translated one after another."""

    def __init__(
        self,
        program: Program,
        nodes: Sequence[Any],
        known: dict[str, Tensor],
        outputs: Sequence[str],
        opsets: Any,
        late: frozenset[str] = frozenset(),
    ) -> None:
        self.program, self.nodes, self.known, self.opsets = program, nodes, known, opsets
        self.uses = Counter(name for node in nodes for name in node.input)
        self.uses.update(dict.fromkeys(outputs, 2))
        self.squared: dict[str, Any] = {}  # products that are only squared and summed
        self.late = late  # results that are computed where they are needed
        self.moved: dict[
            str, Any
        ] = {}  # nodes that move elements and are computed again, by output
        self.made: dict[str, int] = {}  # where they were translated last
        state = known.get(MEMORY_INPUTS[0])
        self.state = None if state is None or state.value is not None else state

    def add_all(self, steps: Sequence[Any]) -> None:
        """Translate nodes, and stages of nodes that treat points one by one."""
        for place, step in enumerate(steps):
            if isinstance(step, PointStage):
                self._add_stage(step)
            else:
                self.add(step, place)

    def _add_stage(self, stage: PointStage) -> None:
        """Translate a stage, whose inputs and outputs are stored for all points."""
        made = {name for node in stage.nodes for name in node.output}
        outside = {name for node in stage.nodes for name in node.input} - made
        for name in sorted(outside & self.known.keys()):
            if self.known[name].pending:
                self.known[name] = self.program.stored(self.known[name])
        known = {name: tensor for name, tensor in self.known.items() if name not in made}
        with self.program.stage(stage.points):
            for name in stage.tiled:
                known[name] = self.program.tile_of(known[name], self.program.tile)
            inner = _Translation(self.program, stage.nodes, known, stage.outputs, self.opsets)
            inner.add_all(stage.nodes)
            for name in stage.outputs:
                self.known[name] = self.program.whole_of(known[name], stage.points)

    def add(self, node: Any, place: int) -> None:
        """Translate the next node."""
        if self._is_only_squared(node):
            self.squared[node.output[0]] = node
            return
        product = self.squared.get(node.input[0]) if node.input else None
        if product is not None:
            self.program.begin(_comment(node))
            keepdims = all(a.i for a in node.attribute if a.name == "keepdims")
            a, b = (self.known[name] for name in product.input)
            self.known[node.output[0]] = squares_of_product(self.program, a, b, keepdims)
            return
        if node.op_type == "Identity" and self._is_memory(node.input[0]):
            self.known[node.output[0]] = self.known[node.input[0]]
            return
        from_memory = any(self._of_memory(name) for name in node.input)
        if node.output[0] in self.late or (from_memory and node.op_type in MOVING):
            self.moved |= dict.fromkeys(node.output, node)
        if node.output[0] not in self.late:
            self._translate(node, place)

    def _translate(self, node: Any, place: int) -> None:
        if node.op_type == "Transpose" and self._is_memory(node.input[0]):
            found = [self._unpacked("unpack_columns", 1)]
        else:
            given = [self._given(name, place) for name in node.input]
            found = _translate(self.program, node, given, self.opsets)
        for name, tensor in zip(node.output, found, strict=False):
            several = tensor.pending and self.uses[name] > 1
            self.known[name] = self.program.stored(tensor) if several else tensor
            self.made[name] = place

    def _given(self, name: str, place: int) -> Tensor | None:
        """An input of a node; the memory of a set, and what is moved of it, anew."""
        if self._is_memory(name):
            return self._unpacked("unpack", 0)
        if name in self.moved and place - self.made.get(name, place - FAR - 1) > FAR:
            self._translate(self.moved[name], place)
        return self.known.get(name)

    def _of_memory(self, name: str) -> bool:
        """Whether a value is the memory of a set, or elements of it that were moved."""
        return self._is_memory(name) or (name in self.moved and name not in self.late)

    def _is_memory(self, name: str) -> bool:
        return self.state is not None and self.known.get(name) is self.state

    def _unpacked(self, function: str, first: int) -> Tensor:
        """The memory of a set, written by a function of C with this axis first."""
        assert self.state is not None
        shape = self.state.shape[first], self.state.shape[1 - first]
        unpacked = self.program.new(self.state.kind, shape)
        self.program.shared.unpacking[function] = None
        self.program.emit(f"    {function}(work, memory, {unpacked.name});", unpacked)
        return unpacked

    def _is_only_squared(self, node: Any) -> bool:
        """Whether a node is a product that is only needed for sums of squares along its rows."""
        if node.op_type != "MatMul" or self.uses[node.output[0]] != 1:
            return False
        left, right = (self.known.get(name) for name in node.input)
        if left is None or right is None or left.rank < 2 or right.rank != 2:
            return False
        if any(t.count == Size(0) for t in (left, right)) or left.value is not None:
            return False
        (user,) = (other for other in self.nodes if node.output[0] in other.input)
        axes = self.known.get(user.input[1]) if len(user.input) > 1 else None
        if user.op_type != "ReduceSumSquare" or axes is None:
            return False
        return axes.numbers("an axis") == [left.rank - 2]


def _with_sound_memory(nodes: Sequence[Any]) -> list[Any]:
    """The nodes without the guard against a memory that is not finite: that of C code is."""
    from onnx import helper

    return [
        helper.make_node("Identity", [node.input[1]], list(node.output))
        if node.op_type == "Where" and node.input[1] in MEMORY_INPUTS
        else node
        for node in nodes
    ]


def added_rows(model: Any, chosen: Mapping[str, Tensor]) -> str:
    """Name of the value with the rows that readings add to the state of a set.

    chosen: Conditions that are fixed, by name.
    """
    switch = {SET_SWITCH: Tensor.constant(np.ones(1, np.bool_), SET_SWITCH)}
    nodes = _without_branches(model.graph, {**switch, **chosen})
    makers = {name: node for node in nodes for name in node.output}
    joined = _source(makers, MEMORY_OUTPUTS[0], "Concat")
    return str(joined.input[1])


def rows_are_apart(model: Any) -> bool:
    """Whether the rows that readings add to the state of a set do not depend on that state.

    They can then be computed without it, and without the answer.

    Raises `ModelFileError` unless the state is passed on with further rows below it: packed rows
    are added to a factor in double precision, and earlier ones cannot be changed.
    """
    switch = {SET_SWITCH: Tensor.constant(np.ones(1, np.bool_), SET_SWITCH)}
    state, grown = MEMORY_INPUTS[0], MEMORY_OUTPUTS[0]
    nodes = _without_branches(model.graph, switch)
    makers = {name: node for node in nodes for name in node.output}
    joined = _source(makers, grown, "Concat")
    if joined is None or _source(makers, joined.input[0], "", state) is None:
        raise ModelFileError(
            f"export-c needs a graph whose {grown} is {state} with the rows of new readings "
            "below it; this graph changes earlier rows"
        )
    wanted = {*joined.input[1:], ROW_IN_RANGE}
    return not any(state in node.input for node in needed_nodes(nodes, wanted)[0])


def _source(makers: dict[str, Any], name: str, kind: str, wanted: str = "") -> Any:
    """The node of a kind, or the input, that a value is passed on from, if need be guarded."""
    passing = {"Identity": 0, "Where": 1}  # a guard: the value where it is sound, else a constant
    while name != wanted:
        node = makers.get(name)
        if node is None or node.op_type == kind:
            return node
        if node.op_type not in passing:
            return None
        name = node.input[passing[node.op_type]]
    return name


def _translate(
    program: Program, node: Any, inputs: list[Tensor | None], opsets: Any
) -> list[Tensor]:
    from onnx import helper

    if node.op_type == "Constant" or (
        node.op_type in OPERATORS and all(t is None or t.value is not None for t in inputs)
    ):
        return _computed_now(node, inputs, opsets)
    if node.op_type not in OPERATORS:
        raise ModelFileError(f"operator {node.op_type} is not known to export-c")
    attributes = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    if "value" in attributes:
        from onnx import numpy_helper

        attributes["value"] = numpy_helper.to_array(attributes["value"])
    translated = Node(node.op_type, tuple(inputs), attributes, len(node.output))
    before = len(program.statements)
    program.begin(_comment(node))
    found = OPERATORS[node.op_type](program, translated)
    if all(tensor.count == Size(0) for tensor in found):
        del program.statements[before:]
        return [_empty(tensor) for tensor in found]
    return found


def _computed_now(node: Any, inputs: list[Tensor | None], opsets: Any) -> list[Tensor]:
    """Outputs of a node whose inputs are constant, by ONNX's reference implementation."""
    from onnx import helper
    from onnx.reference import ReferenceEvaluator

    values = {
        name: tensor.value
        for name, tensor in zip(node.input, inputs, strict=True)
        if tensor is not None
    }
    infos = [
        helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(v.dtype), v.shape)
        for name, v in values.items()
        if v is not None
    ]
    outputs = [name for name in node.output if name]
    ends = [helper.make_empty_tensor_value_info(name) for name in outputs]
    graph = helper.make_graph([node], "constant", infos, ends)
    model = helper.make_model(graph, opset_imports=opsets)
    found = ReferenceEvaluator(model).run(None, values)
    return [Tensor.constant(np.asarray(x), n) for x, n in zip(found, outputs, strict=True)]


def longest_shortcut(model: Any) -> str | None:
    """The condition of the shortcut that computes most; None where all but pass values on.

    C code has a branch for this one, and takes the general way of the others.
    """
    lengths: dict[str, int] = {}
    graphs = [model.graph]
    while graphs:
        for node in graphs.pop().node:
            branches = {a.name: a.g for a in node.attribute} if node.op_type == "If" else {}
            graphs += branches.values()
            if branches and node.doc_string == SHORTCUT:
                lengths[node.input[0]] = len(branches["then_branch"].node)
    name = max(lengths, key=lengths.__getitem__, default=None)
    return name if name is not None and lengths[name] > 1 else None


def _without_branches(graph: Any, known: dict[str, Tensor]) -> list[Any]:
    """The nodes of a graph, with each If node replaced by its chosen branch.

    Of a shortcut whose condition is not known, that is the general way.
    """
    from onnx import helper, numpy_helper

    nodes: list[Any] = []
    for node in graph.node:
        if node.op_type != "If":
            nodes.append(node)
            continue
        condition = known.get(node.input[0])
        if condition is not None and condition.value is not None:
            chosen = "then_branch" if condition.value.all() else "else_branch"
        elif node.doc_string == SHORTCUT:
            chosen = "else_branch"
        else:
            raise ModelFileError(
                "operator If whose condition depends on the readings is not known to export-c"
            )
        branch = next(helper.get_attribute_value(a) for a in node.attribute if a.name == chosen)
        for initial in branch.initializer:
            known[initial.name] = Tensor.constant(numpy_helper.to_array(initial), initial.name)
        nodes += _without_branches(branch, known)
        nodes += [
            helper.make_node("Identity", [own.name], [name])
            for own, name in zip(branch.output, node.output, strict=True)
        ]
    return nodes


def _comment(node: Any) -> str:
    made = ", ".join(name for name in node.output if name)
    return f"{made} = {node.op_type}({', '.join(node.input)})"


def _empty(tensor: Tensor) -> Tensor:
    """A constant of a shape without elements."""
    dtype = {"float": np.float32, "double": np.float64, "int": np.int64, "bool": np.bool_}
    sizes = [size.constant if size.fixed else 0 for size in tensor.shape]
    return Tensor.constant(np.zeros(sizes, dtype[tensor.kind]), "")
