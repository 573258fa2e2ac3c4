"""`soilml export step`: one step of a stream as an ONNX file of fixed shapes."""

from __future__ import annotations

import argparse

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile, OutputFile

DESCRIPTION = """\
Write the set posterior of MODEL.onnx as OUT.onnx, in which every shape is a
number: one row in, and a memory that is always as large as it can be. It is
for compilers that need fixed shapes, such as those of accelerators.

  soilml export step exported/wheel.onnx wheel_step.onnx

docs/reference/onnx.md says how its memory is fed from step to step. Python
uses MODEL.onnx itself; soilml export c writes C that needs no library.
"""
MOST_ROWS = 4096  # Rows that one step may take


ARGUMENTS = (
    ("model MODEL.onnx", "a model file", InputFile),
    ("out OUT.onnx", "file to write", OutputFile),
    ("--step-rows N (1)", "rows that each step takes", whole_number_from(1, MOST_ROWS)),
)


def run(args: argparse.Namespace) -> int:
    """Write the graph."""
    from soilml.cli.output import tell
    from soilml.optional_imports import need

    need("onnx", "export step")
    import onnx

    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import ONE_STEP, find_model
    from training.export.model_file import write_model
    from training.export.one_step import one_step_graph

    file = find_model(args.model)
    metadata = Estimator.load(file).metadata
    graph = one_step_graph(onnx.load(str(file)), str(file), args.step_rows)
    own = {key: value for key, value in metadata.items() if not key.endswith("_sha256")}
    kept = {key: metadata[key] for key in ("recipe_sha256", "data_sha256") if key in metadata}
    origin = {"soilml_kind": ONE_STEP, "step_of_graph_sha256": metadata["graph_sha256"]}
    write_model(graph, own | kept | origin, args.out)
    memory = next(v for v in graph.graph.input if v.name == "memory").type.tensor_type.shape.dim
    tell(
        f"written: {args.out}; {args.step_rows} rows a step, memory {memory[0].dim_value} x "
        f"{memory[1].dim_value}, {len(graph.graph.node)} nodes"
    )
    return 0
