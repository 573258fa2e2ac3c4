"""Nodes and constants of ONNX graphs, addressed by name.

`training.onnx_graph.value` adds operators to it. Bytes of a file depend on the order of nodes and
constants, which are numbered as they are added.

A constant or a node that is there already is not added again: its name is returned. A method of
several nodes becomes a local function of the model, a *composite*: onnxruntime replaces it by its
nodes when it loads the file, and C code has a template for it.

The operator set and file version are readable by every onnxruntime since 1.14; the defaults of the
onnx package are newer than that. Every node has a name of its own: up to release 1.21, onnxruntime
derives the names of fused nodes from them, and refuses a graph in which two fused nodes get the
same one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from soilml.onboard.set_contract import SET_SWITCH

Output = tuple[int, list[Any]]  # Element type and shape of a graph's output

#: ONNX's numbers of the element types of inputs and outputs (onnx.TensorProto.DataType).
FLOAT, BOOL = 1, 9

DOMAIN = "soilml"  # Of the local functions

OPSET = 18
IR_VERSION = 9
#: Begins the names of the results of an If node whose first branch is right in every case: the
#: other one saves time where the case is simple.
SHORTCUT = "shortcut"


class Graph:
    """Nodes and constants of a graph under construction.

    prefix: Prefix of the names of all its nodes and constants; branches of one graph need different
        ones.
    functions: Local functions of the model by name, which its branches share.
    """

    def __init__(self, prefix: str = "", functions: dict[str, Any] | None = None) -> None:
        self._prefix = self._own = prefix  # of constants, and of nodes
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self._names_of_constants: dict[tuple[Any, ...], str] = {}
        self._names_of_nodes: dict[tuple[Any, ...], list[str]] = {}
        self.functions: dict[str, Any] = {} if functions is None else functions
        self._domains: dict[str, int] = {}

    def branch(self, prefix: str) -> Graph:
        """A graph for one branch of this one."""
        made = Graph(prefix, self.functions)
        made._domains = self._domains
        return made

    def inline(self, model: Any, given: str) -> str:
        """Add the nodes of a model of one input, which reads `given`; its first output's name.

        Operators of further domains are then needed to run the graph.
        """
        from onnx import compose

        prefix = f"{self._own}m{len(self._nodes)}_"
        graph = compose.add_prefix(model, prefix).graph
        self.op("Identity", given, out=graph.input[0].name)
        self._nodes.extend(graph.node)
        self._constants.extend(graph.initializer)
        self._domains |= {o.domain: o.version for o in model.opset_import if o.domain}
        return str(graph.output[0].name)

    def constant(self, value: Any, exact: bool = False, name: str = "") -> str:
        """The name of a constant array; floating-point numbers become float64 unless `exact`.

        A floating-point number is one of an array of one element. A name that is given is kept.
        """
        from onnx import numpy_helper

        array = np.asarray(value)
        if array.dtype.kind == "f" and not exact:
            array = array.astype(np.float64)
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._names_of_constants:
            name = f"{self._prefix}{name or f'c{len(self._constants)}'}"
            if array.ndim or array.dtype.kind == "f":
                array = np.ascontiguousarray(array)
            self._constants.append(numpy_helper.from_array(array, name))
            self._names_of_constants[key] = name
        return self._names_of_constants[key]

    def op(self, kind: str, *inputs: str, out: str | None = None, **attributes: Any) -> str:
        """Add a node with one output, and return the name of the output."""
        return self.ops(kind, 1, *inputs, out=out, **attributes)[0]

    def ops(
        self,
        kind: str,
        count: int,
        *inputs: str,
        out: str | None = None,
        outs: list[str] | None = None,
        **attributes: Any,
    ) -> list[str]:
        """Add a node with several outputs, and return their names: new ones, or `outs`."""
        from onnx import helper

        key = (kind, count, inputs, repr(sorted(attributes.items())))
        unnamed = out is None and outs is None
        if unnamed and key in self._names_of_nodes:
            return self._names_of_nodes[key]
        count_before = len(self._nodes)
        name = out or f"{self._own}v{count_before}"
        names = outs or [name, *[f"{name}_{i}" for i in range(1, count)]]
        own = f"{self._own}n{count_before}"
        self._nodes.append(helper.make_node(kind, list(inputs), names, name=own, **attributes))
        if unnamed:
            self._names_of_nodes[key] = names
        return names

    def composite(
        self,
        name: str,
        inputs: Mapping[str, str],
        outputs: Sequence[str],
        body: Callable[[Graph], Sequence[str]],
    ) -> list[str]:
        """Add a call of a local function, and return the names of its results.

        inputs: Names of values by the names that they have in the function, where values that it
            does not read stand for the C code alone.
        outputs: Names of the results in the function.
        body: Adds the nodes of the function to a graph, and returns the names of the results.

        Raises `ValueError` where a function of that name is another one.
        """
        from onnx import helper

        inner = Graph("", self.functions)
        made = body(inner)
        for one, wanted in zip(made, outputs, strict=True):
            inner.op("Identity", one, out=wanted)
        nodes, constants = inner.needed(outputs)
        given = [
            helper.make_node("Constant", [], [c.name], name=c.name, value=c) for c in constants
        ]
        opsets = [helper.make_opsetid("", OPSET), helper.make_opsetid(DOMAIN, 1)]
        found = helper.make_function(
            DOMAIN, name, list(inputs), list(outputs), given + nodes, opsets
        )
        known = self.functions.setdefault(name, found)
        if known.SerializeToString(deterministic=True) != found.SerializeToString(
            deterministic=True
        ):
            raise ValueError(f"there is another function {name}")
        return self.ops(name, len(outputs), *inputs.values(), domain=DOMAIN)

    def either_of(self, condition: str, bodies: Sequence[Callable[[], Sequence[str]]]) -> list[str]:
        """Add an If node for results of the first body if a condition is true, else of the second.

        Bodies add nodes to this graph, which lie in a branch of the If node, and return the names
        of as many results. The first one must be right whatever the condition is. Constants lie in
        the graph itself.
        """
        from onnx import helper

        place, branches, names = f"{self._own}{SHORTCUT}{len(self._nodes)}", [], list[str]()
        kept = self._own, self._nodes, self._names_of_nodes
        for number, body in enumerate(bodies):
            self._own, self._nodes, self._names_of_nodes = f"{place}_{number}_", [], dict(kept[2])
            made = enumerate(body())
            names = [self.op("Identity", one, out=f"{self._own}out{k}") for k, one in made]
            infos = [helper.make_tensor_value_info(name, FLOAT, None) for name in names]
            branches.append(helper.make_graph(self.needed(names)[0], self._own, [], infos))
            self._own, self._nodes, self._names_of_nodes = kept
        outs = [f"{place}_{k}" for k in range(len(names))]
        then, other = branches
        return self.ops("If", len(outs), condition, then_branch=then, else_branch=other, outs=outs)

    def rename_last(self, name: str, new: str) -> None:
        """Rename an output of the node that was added last, which nothing reads yet.

        Raises `ValueError` if `name` is not an output of that node.
        """
        if not self._nodes or name not in self._nodes[-1].output:
            raise ValueError(f"{name} is not an output of the last node; name it right away")
        last = self._nodes[-1]
        last.output[list(last.output).index(name)] = new
        self._names_of_nodes = {k: v for k, v in self._names_of_nodes.items() if name not in v}

    def default(self, name: str, value: Any) -> None:
        """Give an input of the graph a default value, for callers that do not feed it."""
        from onnx import numpy_helper

        self._constants.append(numpy_helper.from_array(np.asarray(value), name))

    def either(
        self, condition: str, first: Graph, second: Graph, outputs: Mapping[str, Output]
    ) -> None:
        """Add an If node: outputs of the first graph if the condition is true, else of the second.

        Only that branch is run. Each branch names its outputs `<prefix><output>`; outputs that it
        lacks are empty.
        """
        self.ops(
            "If",
            0,
            condition,
            then_branch=first.as_branch(outputs),
            else_branch=second.as_branch(outputs),
            outs=list(outputs),
        )

    def as_branch(self, outputs: Mapping[str, Output]) -> Any:
        """This graph as a branch whose outputs are named `<prefix><output>`; others are empty."""
        from onnx import helper

        computed = {name for node in self._nodes for name in node.output}
        infos = []
        for name, (kind, shape) in outputs.items():
            own = self._prefix + name
            if own not in computed:
                empty = np.zeros([0] * len(shape), helper.tensor_dtype_to_np_dtype(kind))
                self.op("Identity", self.constant(empty, exact=True), out=own)
            infos.append(helper.make_tensor_value_info(own, kind, [None] * len(shape)))
        nodes, constants = self.needed([info.name for info in infos])
        return helper.make_graph(nodes, f"{self._prefix}branch", [], infos, constants)

    def needed(self, outputs: Iterable[str]) -> tuple[list[Any], list[Any]]:
        """The nodes and constants on which outputs depend; values of branches are included."""
        nodes, wanted = needed_nodes(self._nodes, outputs)
        return nodes, [one for one in self._constants if one.name in wanted]

    @property
    def opsets(self) -> list[tuple[str, int]]:
        """Operator sets of the model."""
        own = [(DOMAIN, 1)] if self.functions else []
        return [("", OPSET), *own, *sorted(self._domains.items())]

    def model(self, inputs: Mapping[str, list[Any]], outputs: Mapping[str, Output]) -> Any:
        """The finished and checked ONNX model.

        inputs: Name -> shape; they are float32, but `SET_SWITCH`, which is boolean.
        outputs: Name -> element type and shape.
        """
        from onnx import checker, helper

        nodes, constants = self.needed([*outputs, *inputs])
        graph = helper.make_graph(
            nodes,
            "soilml",
            [
                helper.make_tensor_value_info(n, BOOL if n == SET_SWITCH else FLOAT, s)
                for n, s in inputs.items()
            ],
            [helper.make_tensor_value_info(n, k, shape) for n, (k, shape) in outputs.items()],
            constants,
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid(*one) for one in self.opsets],
            functions=list(self.functions.values()),
            producer_name="soilml",
        )
        model.ir_version = IR_VERSION
        checker.check_model(model, full_check=True)
        return model


def without_branches(graph: Any, chosen: Callable[[Any], str]) -> tuple[list[Any], list[Any]]:
    """Nodes and constants of a graph, with each If node replaced by the branch that is chosen."""
    from onnx import helper

    nodes: list[Any] = []
    constants = list(graph.initializer)
    for node in graph.node:
        if node.op_type != "If":
            nodes.append(node)
            continue
        branch = next(a.g for a in node.attribute if a.name == chosen(node))
        inside, of_branch = without_branches(branch, chosen)
        results = zip([value.name for value in branch.output], node.output, strict=True)
        nodes += inside
        nodes += [helper.make_node("Identity", [own], [new], name=new) for own, new in results]
        constants += of_branch
    return nodes, constants


def needed_nodes(nodes: Iterable[Any], outputs: Iterable[str]) -> tuple[list[Any], set[str]]:
    """The nodes on which outputs depend, in their order, and the names of all values they need."""
    wanted, needed = set(outputs), []
    for node in reversed(list(nodes)):
        if wanted.intersection(node.output):
            needed.append(node)
            wanted.update(_read_by(node))
    return needed[::-1], wanted


def _read_by(node: Any) -> set[str]:
    """Names of the values that a node reads, also in its branches."""
    branches = [a.g for a in node.attribute if a.HasField("g")]
    inside = (_read_by(inner) for branch in branches for inner in branch.node)
    return set(node.input).union(*inside, *({o.name for o in b.output} for b in branches))


def session_of(model: Any) -> Any:
    """An onnxruntime session of a model, on one thread."""
    from soilml.onboard.model_file import create_session

    return create_session(model.SerializeToString())
