"""The functions of a C file that compute a graph: for one row, a step of a set, its answer."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.set_contract import (
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    ROW_IN_RANGE,
    SET_PREFIX,
    SET_SWITCH,
)
from training.export_c.graph_translation import added_rows, longest_shortcut, translate_graph
from training.export_c.interface import Interface, input_shapes
from training.export_c.point_stages import SMALL_TILE, TILE
from training.export_c.program import Program, SharedParts, plan_memory
from training.export_c.stage_text import ARRAYS, WIDTH, stage_functions
from training.export_c.tensor import Shape, Size, Tensor

#: Element types of the constants that stand for inputs.
DTYPES = {"double": np.float64, "float": np.float32, "int": np.int32, "bool": np.bool_}
#: Counts that a function may be given: rows of readings, and rows of the state.
ROWS, KEPT = "rows", "kept"
#: Outputs that a step needs: the state, the counts, and which rows are in range.
STEP_OUTPUTS = (*MEMORY_OUTPUTS, ROW_IN_RANGE)


@dataclass(frozen=True)
class GraphFunction:
    """One function: its text, and what it takes and gives."""

    #: name and C text of the function
    name: str
    text: str
    #: inputs of the graph that it reads, after the working memory and the counts
    inputs: tuple[str, ...]
    #: C type and number of elements of each output; -1 for a number that varies
    outputs: dict[str, tuple[str, int]]
    lengths: dict[str, int]  # elements of working memory by type
    unpacks: bool  # whether it reads the memory of a set
    constants: frozenset[str]  # names of the constant arrays that it reads
    counts: tuple[str, ...]  # counts that it is given
    returns: str  # C type of what it returns

    def head(self, kinds: Mapping[str, str]) -> str:
        """Its declaration, from the C types of inputs."""
        parameters = [
            "WORK *work",
            *(["const MEMORY *memory"] if self.unpacks else []),
            *(f"int {count}" for count in self.counts),
            *(f"const {kinds[name]} *in_{name}" for name in self.inputs),
            *(f"const {kind} **out_{key}" for key, (kind, _) in self.outputs.items()),
        ]
        return f"static {self.returns} {self.name}({', '.join(parameters)})"

    def arguments(self) -> list[str]:
        """What a function with the same names gives it, but for the outputs."""
        memory = ["memory"] if self.unpacks else []
        return ["work", *memory, *self.counts, *(f"in_{name}" for name in self.inputs)]

    def passed_on(self, other: GraphFunction) -> list[str]:
        """What it gives a function with the same outputs."""
        return [*other.arguments(), *(f"out_{key}" for key in self.outputs)]


def single_function(model: Any, interface: Interface, shared: SharedParts) -> GraphFunction:
    """The estimate from one row."""
    inputs = _inputs(model, {ROWS: Size(1), KEPT: Size(0)}, switch=False)
    names = [o.name for o in model.graph.output]
    return graph_function("single_graph", model, Program(shared, {}), inputs, names)


def step_function(
    model: Any, interface: Interface, shared: SharedParts, rows: int
) -> GraphFunction:
    """The rows that readings add to the state of a set, and the counts; no answer."""
    inputs = _inputs(model, {ROWS: Size.of(ROWS), KEPT: Size(0)}, switch=True)
    return graph_function("step_graph", model, Program(shared, {ROWS: rows}), inputs, STEP_OUTPUTS)


def update_function(
    model: Any, interface: Interface, shared: SharedParts, rows: int
) -> GraphFunction:
    """The state with the rows that readings add, the counts, and the answer."""
    inputs = _inputs(model, {ROWS: Size.of(ROWS), KEPT: Size.of(KEPT)}, switch=True)
    bounds = {ROWS: rows, KEPT: interface.columns}

    def way(name: str, chosen: Mapping[str, Tensor]) -> GraphFunction:
        added = added_rows(model, chosen)
        wanted = [added, *STEP_OUTPUTS[1:], *_answers(model)]
        given, program = {**inputs, **chosen}, Program(shared, bounds, _tile(rows))
        made = graph_function(name, model, program, given, wanted, not interface.small)
        outputs = {(MEMORY_OUTPUTS[0] if k == added else k): v for k, v in made.outputs.items()}
        return replace(made, outputs=outputs)

    return _with_shortcut("update", model, inputs, Program(shared, bounds), way)


def answer_function(
    model: Any, interface: Interface, shared: SharedParts, rows: int
) -> GraphFunction:
    """The estimate from the state of a set."""
    inputs = _inputs(model, {ROWS: Size(0), KEPT: Size.of(KEPT)}, switch=True)
    bounds = {KEPT: interface.columns}

    def way(name: str, chosen: Mapping[str, Tensor]) -> GraphFunction:
        given, program = {**inputs, **chosen}, Program(shared, bounds, _tile(rows))
        return graph_function(name, model, program, given, _answers(model), not interface.small)

    return _with_shortcut("answer", model, inputs, Program(shared, bounds), way)


def _tile(rows: int) -> int:
    """Points that a stage takes at a time, by the most rows of a step: a small board reads one."""
    return TILE if rows > 1 else SMALL_TILE


def _with_shortcut(
    name: str,
    model: Any,
    inputs: Mapping[str, Tensor],
    program: Program,
    way: Callable[[str, Mapping[str, Tensor]], GraphFunction],
) -> GraphFunction:
    """A function that takes the way of readings with noise alone where they are, else the general.

    model: With the longest of its shortcuts; a function without one has no branch.
    program: Receives the statements of the condition.
    way: The function of a name in which some conditions are fixed.
    """
    condition = longest_shortcut(model)
    if condition is None:
        return way(f"{name}_graph", {})
    asked = graph_function(f"{name}_is_noise_alone_graph", model, program, inputs, [condition])
    quick, general = (
        way(f"{name}_{kind}_graph", {condition: Tensor.constant(np.asarray([taken]), condition)})
        for kind, taken in (("noise_alone", True), ("with_errors", False))
    )
    whole = replace(
        general,
        name=f"{name}_graph",
        inputs=tuple(n for n in inputs if any(n in f.inputs for f in (asked, quick, general))),
        counts=tuple(dict.fromkeys((*general.counts, *asked.counts, *quick.counts))),
        lengths={
            kind: max(f.lengths.get(kind, 0) for f in (asked, quick, general))
            for kind in {**general.lengths, **quick.lengths, **asked.lengths}
        },
        unpacks=True,
        constants=asked.constants | quick.constants | general.constants,
    )
    kinds = {n: inputs[n].kind for n in whole.inputs}
    back = "return " if whole.returns == "int" else ""
    lines = [
        *_wrapped(whole.head(kinds), 0),
        "{",
        "    const bool *noise_alone;",
        *_wrapped(f"{asked.name}({', '.join([*asked.arguments(), '&noise_alone'])});", 4),
        "    if (*noise_alone)",
        *_wrapped(f"{back}{quick.name}({', '.join(whole.passed_on(quick))});", 8),
        *(["    else"] if not back else []),
        *_wrapped(
            f"{back}{general.name}({', '.join(whole.passed_on(general))});", 4 if back else 8
        ),
        "}",
    ]
    return replace(
        whole, text="\n\n".join([asked.text, quick.text, general.text, "\n".join(lines)])
    )


def _wrapped(text: str, indent: int) -> list[str]:
    """Lines of C, those after the first indented by four more."""
    return textwrap.wrap(
        text, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 4)
    )


def _answers(model: Any) -> list[str]:
    """Outputs that belong to a set."""
    return [o.name for o in model.graph.output if o.name.startswith(SET_PREFIX)]


def _inputs(model: Any, counts: Mapping[str, Size], switch: bool) -> dict[str, Tensor]:
    """The inputs of the graph for given numbers of rows, and the branch of the set posterior."""
    inputs = {}
    for name, (kind, dims) in input_shapes(model).items():
        if name == SET_SWITCH:
            inputs[name] = Tensor.constant(np.asarray([switch]), name)
            continue
        shape: Shape = tuple(
            Size(d) if isinstance(d, int) else counts[KEPT if len(dims) > 1 else ROWS] for d in dims
        )
        empty = any(size == Size(0) for size in shape)
        if empty:
            values: NDArray[Any] = np.zeros([s.constant for s in shape], DTYPES[kind])
            inputs[name] = Tensor.constant(values, name)
        else:
            inputs[name] = Tensor(f"in_{name}", kind, shape)
    return inputs


def graph_function(
    name: str,
    model: Any,
    program: Program,
    inputs: Mapping[str, Tensor],
    wanted: Sequence[str],
    in_tiles: bool = False,
) -> GraphFunction:
    """Translate a graph and write the function, and those of its stages, which it calls.

    Its parameters are the working memory, the counts of the program, the inputs that are read, and
    for each output a pointer that is set to it. It returns the length of an output of variable
    length that is a matrix, if there is one.
    """
    given = tuple(program.bounds)
    state = inputs.get(MEMORY_INPUTS[0])
    unpacks = state is not None and state.value is None
    found = translate_graph(model, program, inputs, wanted, in_tiles)
    plan = plan_memory(program, frozenset(tensor.owner for tensor in found.values()))
    given_on = program.given | {tensor.owner for tensor in found.values()}
    read = [n for n, tensor in inputs.items() if tensor.name in given_on]
    varying = [t.shape[0] for t in found.values() if not t.count.fixed and t.rank > 1]
    kinds = {tensor.name: tensor.kind for tensor in inputs.values()}
    sizes = {k: (t.kind, t.count.constant if t.count.fixed else -1) for k, t in found.items()}
    stages, calls = stage_functions(name, program, plan, kinds)
    code = " ".join(s.code for s in program.statements)
    names = {*re.findall(r"\bw\d+\b", code), *(tensor.owner for tensor in found.values())}
    function = GraphFunction(
        name=name,
        text="",
        inputs=tuple(read),
        outputs=sizes,
        lengths=plan.lengths,
        unpacks=unpacks,
        constants=frozenset(names),
        counts=given,
        returns="int" if varying else "void",
    )
    head = function.head({n: inputs[n].kind for n in read})
    lines = [*_wrapped(head, 0), "{", *calls]
    for key, tensor in found.items():
        place = tensor.name
        if tensor.owner in program.memory:
            kind = program.memory[tensor.owner][0]
            at = f"work->{ARRAYS[kind]} + {plan.offsets[tensor.owner]}"
            place = re.sub(rf"\b{tensor.owner}\b", at, tensor.name)
        lines.append(f"    *out_{key} = {place};")
    lines += [f"    return {varying[0].c};"] if varying else []
    return replace(function, text="\n\n".join([*stages, "\n".join([*lines, "}"])]))
