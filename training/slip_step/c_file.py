"""One step of the slip filter as C99: its graph by `training.export_c`, and functions around it."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.onboard.slip_stream import FLAGS, POSSIBLE, QUANTILES, RECENT
from soilml.slip_filter.filter import SlipFilter
from training.export_c.c_file import BYTES, CRC_BYTES, kernel_texts, template_environment
from training.export_c.c_text import array
from training.export_c.interface import input_shapes
from training.export_c.program import ARRAYS, SharedParts
from training.export_c.tensor import Tensor
from training.export_c.translation import flat_nodes, translate
from training.slip_step.graph import start_of

#: Entries of the metadata that tell one file from another, and which rover and prior it is for.
IDENTITY = ("graph_sha256", "metadata_sha256", "case_sha256")
OUTPUTS = ("speed", "slip", "probability", "flags", "grounds_out", "recent_out")

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
        key: Tensor(f"in_{key}", kind, tuple(int(d) for d in dims))
        for key, (kind, dims) in input_shapes(model).items()
    }
    known: dict[str, Tensor] = {}
    nodes = flat_nodes(model.graph, known)
    function = translate("step_graph", nodes, known, inputs, OUTPUTS, shared)
    used = shared.used_in(function.text)
    start, _ = start_of(filter_)
    arrays = {ARRAYS[kind]: (kind, length) for kind, length in function.lengths.items()}
    sizes = {
        "work_bytes": sum(BYTES[kind] * length for kind, length in arrays.values()),
        "state_bytes": 4 * (start.size + RECENT + 2),
        "constant_bytes": sum(v.size * BYTES[kind] for _, v, kind in used)
        + 4 * start.shape[0]
        + CRC_BYTES,
    }
    values = {
        "name": name,
        "NAME": name.upper(),
        "origin": origin,
        "version": __version__,
        "wheels": filter_.table.wheels,
        "grounds": start.shape[0],
        "columns": start.shape[1],
        "recent": RECENT,
        "quantiles": len(QUANTILES),
        "codes": CODES,
        "flags": FLAGS,
        "function": function,
        "arrays": arrays,
        "constants": [array(*parts) for parts in used],
        "prior": array("prior", start[:, 0].astype(np.float32), "float"),
        "begin": start[0, 1:].tolist(),
        "kernels": kernel_texts(shared),
        "identity": {key: metadata[key] for key in IDENTITY},
        "possible": POSSIBLE,
        "finite": [f"all_finite(out_{key}, {prod(s)})" for key, (_, s) in function.outputs.items()],
        "load": (float(filter_.table.load[0]), float(filter_.table.load[-1])),
        **sizes,
    }
    environment = template_environment()
    environment.loader.searchpath.append(str(Path(__file__).parent))
    source, header = (
        environment.get_template(f"slip.{part}.j2").render(values) for part in ("c", "h")
    )
    return source, header
