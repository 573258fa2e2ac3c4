"""What bounds the latency of a model file: nodes of a graph, transcendental functions, arithmetic.

Part of `python bench/run.py board`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import board
import numpy as np
import onnxruntime as ort
from c_export import CALLS, COMPILERS, exported, tasks
from onnx import NodeProto, helper

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.identification.trained_estimator import for_simulated_case
from soilml.onboard.session import create_session
from training.onnx_graph.builder import FLOAT, IR_VERSION, OPSET

ROOT = Path(__file__).parents[1]
#: Operators that evaluate a transcendental function, or a square root.
TRANSCENDENTAL = ("Asinh", "Exp", "Log", "Softmax", "Sqrt", "Tanh")
#: An operator that does next to nothing.
NOTHING = "Abs"
#: The calls of each file, as `c_export.tasks` names them.
TIMED = {"wheel": ("one reading", "set of 16"), "any_wheel": ("set of 16",)}

#: What a node that was run is known by: its operator, and the shape of its first output.
Run = list[tuple[str, list[int]]]


def section(folder: Path) -> str:
    """All tables of the latency on board."""
    bounds = table(folder) if COMPILERS else "No C compiler on this machine."
    return "\n\n".join([board.latency(), bounds, board.steps(), board.cold_start()])


def table(folder: Path) -> str:
    """A table of times (us): a call, its nodes doing nothing, its functions, the same in C."""
    case, names, counts, calls = read_recipe("wheel").case, [], [], [chain(1)]
    for file, timed in TIMED.items():
        model = exported(file, folder)
        estimator = for_simulated_case(Estimator.load(ROOT / "exported" / f"{file}.onnx"), case)
        for what, outputs, feed, by_c in tasks(file, model, estimator):
            if what in timed:
                run = nodes_run(file, outputs, feed, folder)
                names.append(f"{file}.onnx, {what}")
                counts.append(len(run))
                calls += [partial(estimator.session.run, outputs, feed), chain(len(run))]
                calls += [functions(run), functions(run, NOTHING), by_c]
    one, *taken = board.processor_times(calls, CALLS // 2)
    lines = [
        "What bounds these times: median processor time in microseconds, all in turn. *Nodes "
        "alone*: a graph of as many nodes as the call runs, each of which takes the absolute value "
        "of one number. *Functions*: exponentials, logarithms, hyperbolic functions and square "
        "roots of the call at their sizes, less as many absolute values of these sizes. *In C*: "
        "the exported C file, which does the same arithmetic without nodes. A graph of one node "
        f"takes {one:.0f}.",
        "",
        "| call | nodes run | onnxruntime | nodes alone | functions | in C |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for i, (name, count) in enumerate(zip(names, counts, strict=True)):
        whole, nodes, evaluated, nothing, by_c = taken[5 * i : 5 * i + 5]
        lines.append(
            f"| {name} | {count} | {whole:.0f} | {nodes:.0f} | {max(evaluated - nothing, 0.0):.0f} "
            f"| {by_c:.0f} |"
        )
    return "\n".join(lines)


def nodes_run(file: str, outputs: list[str], feed: dict[str, Any], folder: Path) -> Run:
    """The nodes that a call of a released file runs, by onnxruntime's profile."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.enable_profiling = True
    options.profile_file_prefix = str(folder / "profile")
    options.log_severity_level = 4
    session = ort.InferenceSession(ROOT / "exported" / f"{file}.onnx", options)
    session.run(outputs, feed)
    events = json.loads(Path(session.end_profiling()).read_text())
    nodes = [event["args"] for event in events if event["name"].endswith("_kernel_time")]
    return [(n["op_name"], _shape(n)) for n in nodes if n["op_name"] != "If"]


def _shape(node: dict[str, Any]) -> list[int]:
    return next(iter(node["output_type_shape"][0].values()))


def chain(count: int) -> Callable[[], Any]:
    """A call of a graph of so many nodes that do nothing, one after the other, on one number."""
    nodes = [helper.make_node(NOTHING, [f"v{i}"], [f"v{i + 1}"]) for i in range(count)]
    return _call_of(nodes, {"v0": np.ones(1, np.float32)}, {f"v{count}": [1]})


def functions(run: Run, instead: str | None = None) -> Callable[[], Any]:
    """A call of a graph of the transcendental functions of a call, or of others in their places."""
    chosen = [(op, shape) for op, shape in run if op in TRANSCENDENTAL]
    feed = {f"v{i}": np.full(shape, 0.5, np.float32) for i, (_, shape) in enumerate(chosen)}
    nodes = [
        helper.make_node(instead or op, [f"v{i}"], [f"f{i}"]) for i, (op, _) in enumerate(chosen)
    ]
    return _call_of(nodes, feed, {f"f{i}": shape for i, (_, shape) in enumerate(chosen)})


def _call_of(
    nodes: list[NodeProto], feed: dict[str, Any], outputs: dict[str, list[int]]
) -> Callable[[], Any]:
    """A call of a graph of nodes in a session as model files have one."""
    inputs = [helper.make_tensor_value_info(n, FLOAT, list(v.shape)) for n, v in feed.items()]
    found = [helper.make_tensor_value_info(name, FLOAT, shape) for name, shape in outputs.items()]
    graph = helper.make_graph(nodes, "floor", inputs, found)
    opsets = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=IR_VERSION)
    session = create_session(model.SerializeToString())
    return partial(session.run, list(outputs), feed)
