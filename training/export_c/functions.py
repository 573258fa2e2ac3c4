"""The functions of a C file that compute a graph: for one row, a step of a set, its answer."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
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
from training.export_c.graph_translation import added_rows, translate_graph
from training.export_c.interface import Interface, input_shapes
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
    program = Program(shared, {ROWS: rows, KEPT: interface.columns})
    added, *others = added_rows(model), *STEP_OUTPUTS[1:], *_answers(model)
    function = graph_function(
        "update_graph", model, program, inputs, [added, *others], not interface.small
    )
    outputs = {(MEMORY_OUTPUTS[0] if k == added else k): v for k, v in function.outputs.items()}
    return replace(function, outputs=outputs)


def answer_function(model: Any, interface: Interface, shared: SharedParts) -> GraphFunction:
    """The estimate from the state of a set."""
    inputs = _inputs(model, {ROWS: Size(0), KEPT: Size.of(KEPT)}, switch=True)
    program = Program(shared, {KEPT: interface.columns})
    wanted = _answers(model)
    return graph_function("answer_graph", model, program, inputs, wanted, not interface.small)


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
    parameters = [
        "WORK *work",
        *(["const MEMORY *memory"] if unpacks else []),
        *(f"int {count}" for count in given),
        *(f"const {inputs[n].kind} *in_{n}" for n in read),
        *(f"const {tensor.kind} **out_{key}" for key, tensor in found.items()),
    ]
    head = f"static {'int' if varying else 'void'} {name}({', '.join(parameters)})"
    stages, calls = stage_functions(name, program, plan, kinds)
    lines = [*textwrap.wrap(head, WIDTH, subsequent_indent=" " * 4), "{", *calls]
    for key, tensor in found.items():
        place = tensor.name
        if tensor.owner in program.memory:
            kind = program.memory[tensor.owner][0]
            at = f"work->{ARRAYS[kind]} + {plan.offsets[tensor.owner]}"
            place = re.sub(rf"\b{tensor.owner}\b", at, tensor.name)
        lines.append(f"    *out_{key} = {place};")
    lines += [f"    return {varying[0].c};"] if varying else []
    sizes = {k: (t.kind, t.count.constant if t.count.fixed else -1) for k, t in found.items()}
    code = " ".join(s.code for s in program.statements)
    names = {*re.findall(r"\bw\d+\b", code), *(tensor.owner for tensor in found.values())}
    return GraphFunction(
        name=name,
        text="\n\n".join([*stages, "\n".join([*lines, "}"])]),
        inputs=tuple(read),
        outputs=sizes,
        lengths=plan.lengths,
        unpacks=unpacks,
        constants=frozenset(names),
    )
