"""One step of the slip filter as C99: its graph by `training.export_c`, and functions around it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.onboard.slip_stream import FLAGS, POSSIBLE, QUANTILES, RECENT
from soilml.slip_filter.filter import SlipFilter
from training.export_c.c_file import common_values, template_environment
from training.export_c.c_text import array
from training.export_c.interface import input_shapes
from training.export_c.program import SharedParts
from training.export_c.tensor import Tensor
from training.export_c.translation import flat_nodes, translate
from training.slip_step.graph import start_of

#: Entries of the metadata that tell one file from another, and which rover and prior it is for.
IDENTITY = ("graph_sha256", "metadata_sha256", "case_sha256")
#: Where inputs of the graph lie, and its outputs.
PLACES = {
    "grounds": "state->grounds", "recent": "state->recent", "rim_speed": "row->rim_speed",
    "torque": "row->torque", "load": "row->load", "slope": "(&row->slope)",
    "elapsed": "(&row->elapsed)",
}  # fmt: skip
OUTPUTS = {
    "speed": "work->speed", "slip": "estimate->slips", "probability": "work->probability",
    "flags": "work->flags", "grounds_out": "state->grounds", "recent_out": "state->recent",
}  # fmt: skip

CODES = (
    ("OK", 0, "answered"),
    ("NO_ANSWER", 1, "a flag says why there is no answer: speed and slip mean nothing"),
    ("BAD_READING", -1, "a reading is not finite, or not possible"),
    ("NOT_STARTED", -2, "the state was not started, is damaged, or is of another model file"),
    ("NOT_FINITE", -3, "the answer would not be finite"),
)


def write_slip_c(
    model: Any, filter_: SlipFilter, name: str, origin: str, metadata: Mapping[str, str]
) -> tuple[str, str]:
    """Texts of the C file and of its header.

    model: Of `slip_step_model`.
    name: Prefix of all C names.
    origin: Name of the model file, for the comment at the head.
    metadata: Of the model file.
    """
    shared = SharedParts()
    inputs = {
        key: Tensor(PLACES[key], kind, tuple(int(d) for d in dims))
        for key, (kind, dims) in input_shapes(model).items()
    }
    known: dict[str, Tensor] = {}
    nodes = flat_nodes(model.graph, known)
    parameters = {
        "state": f"{name}_state *state",
        "row": f"const {name}_row *row",
        "estimate": f"{name}_estimate *estimate",
        "work": "WORK *work",
    }
    function = translate("step_graph", nodes, known, inputs, OUTPUTS, shared, parameters, True)
    start, _ = start_of(filter_)
    common = common_values([function], shared)
    values = {
        "name": name,
        "NAME": name.upper(),
        "origin": origin,
        "version": __version__,
        "model_version": __version__,
        "command": "export slip",
        "subject": "slip and speed of a rover without odometry, row by row",
        "wheels": filter_.table.wheels,
        "grounds": start.shape[0],
        "columns": start.shape[1],
        "recent": RECENT,
        "quantiles": len(QUANTILES),
        "codes": CODES,
        "flags": FLAGS,
        "function": function,
        "prior": array("prior", start[:, 0].astype(np.float32), "float"),
        "begin": start[0, 1:].tolist(),
        "identity": {key: metadata[key] for key in IDENTITY},
        "possible": POSSIBLE,
        "load": (float(filter_.table.load[0]), float(filter_.table.load[-1])),
        **common,
        "work_bytes": common["array_bytes"] + 4 * (len(FLAGS) + 4 + len(QUANTILES)),
        "state_bytes": 4 * (start.size + RECENT + 2),
        "constant_bytes": common["constant_bytes"] + 4 * start.shape[0],
    }
    environment = template_environment()
    environment.loader.searchpath.append(str(Path(__file__).parent))
    source, header = (
        environment.get_template(f"slip.{part}.j2").render(values) for part in ("c", "h")
    )
    return source, header
