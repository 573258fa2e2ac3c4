"""A model file as a C file and its header."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.onboard.metadata import read_fields
from soilml.onboard.set_contract import SET_SWITCH
from soilml.onboard.tracking.soil_tracker import DEFAULT_LENGTH
from soilml.quantities import Z_90
from training.export_c.c_text import array, number
from training.export_c.interface import input_shapes, read_interface
from training.export_c.program import ARRAYS, Function, SharedParts
from training.export_c.set_functions import (
    SCALARS,
    estimate_place,
    set_functions,
    shared_floats,
)
from training.export_c.single_precision import in_single_precision
from training.export_c.tensor import Tensor
from training.export_c.tracker import tracker_values
from training.export_c.translation import flat_nodes, translate, with_templates

#: Bytes of an element, as all usual compilers have them; the C file checks what follows from it.
BYTES = {"double": 8, "float": 4, "int": 4, "bool": 1}
#: Rows that one call takes, unless the user wants another number.
ROWS_PER_CALL = 32
TEMPLATES = Path(__file__).parent / "templates"
KERNELS = TEMPLATES / "kernels"
#: Entries of the metadata that tell one file from another, and what they were trained from.
IDENTITY = ("graph_sha256", "metadata_sha256", "data_sha256", "recipe_sha256", "spec_sha256")
SINGLE_OUTPUTS = ("mean", "std", "covariance", "in_range")  # Of a file that estimates from rows


#: What functions return: zero or more with an answer, below zero where nothing was changed.
CODES = (
    ("OK", 0, "answered"),
    ("OUT_OF_RANGE", 1, "readings out of the range of training, or inconsistent with any soil"),
    ("BAD_READING", -1, "a reading is not finite or impossible, or a single row lacks one"),
    ("BAD_STD", -2, "a standard deviation is negative, zero or not finite"),
    ("BAD_CONTEXT", -3, "a value for a set is out of range, or not begun by usual_context"),
    ("BAD_COUNT", -4, "no row, or more rows than one step takes"),
    ("NOT_STARTED", -5, "the memory was not started, is damaged, or of another model file"),
    ("NO_ROWS", -6, "the memory has no row yet"),
    ("NOT_FINITE", -7, "numbers beyond those of float: a standard deviation is absurd"),
)


@dataclass(frozen=True)
class CFile:
    """Texts of the C file and of its header, and the memory that they need."""

    #: c99
    source: str
    header: str
    #: memory of one set, working memory of a call, and constants
    memory_bytes: int
    work_bytes: int
    constant_bytes: int


def write_c(
    model: Any,
    metadata: Mapping[str, str],
    name: str,
    origin: str,
    rows: int = ROWS_PER_CALL,
    length: int = DEFAULT_LENGTH,
) -> CFile:
    """Translate a model file.

    model: The model with its graph.
    metadata: The metadata of the file.
    name: Prefix of all C names that a user sees.
    origin: Name of the model file, for the comment at the head.
    rows: Rows that one step takes at most.
    length: Rows that a tracker remembers.

    Raises `ModelFileError` for a graph with an operator, a type or a shape that is not known.
    """
    model = with_templates(in_single_precision(model, metadata)[0])
    interface, shared = read_interface(model, metadata), SharedParts()
    fields = read_fields(metadata)
    noise = fields["sets"].noise if fields["sets"] else {}
    single = single_function(model, shared, name) if interface.single else None
    sets = set_functions(model, interface, shared, rows, name) if interface.sets else None
    functions = [*([single] if single else []), *(sets.all if sets else [])]
    memory = members = of_sampler = 0
    if sets:
        shared.kernel("tanh_of", "float")
        columns, real = interface.columns, BYTES[interface.precision]
        of_sampler = 4 * sum(np.size(x) for x in sets.values["arrays"].values())
        members = 4 * sum(prod(sizes) for sizes in sets.members.values())
        members += (4 * len(interface.rows) + 4) * rows + columns * real + 40
        members += sum(BYTES[kind] * prod(shape) for kind, shape in sets.answer.outputs.values())
        memory = columns * (columns + 1) // 2 * real + (4 + len(interface.context)) * 4 + 24
        memory = -(-memory // 8) * 8
    common = common_values(functions, shared, shared_floats(sets.values) if sets else 0)
    sizes = {
        "memory_bytes": memory,
        "work_bytes": -(-(common["array_bytes"] + members) // 8) * 8,
        "constant_bytes": common["constant_bytes"] + of_sampler,
    }
    environment = template_environment()
    values = {
        "name": name,
        "NAME": name.upper(),
        "origin": origin,
        "version": __version__,
        "model_version": metadata["soilml_version"],
        "command": "export c",
        "subject": "estimates of the soil under a running gear",
        "identity": {key: metadata[key] for key in IDENTITY if key in metadata},
        "noise": noise,
        "codes": CODES,
        "interface": interface,
        "single": single,
        "sets": sets,
        "sampler": sets.values if sets else {},
        "rows": rows,
        "quantities": list(zip(fields["names"], fields["units"], strict=True)),
        "lower": fields["prior"].lower.tolist(),
        "upper": fields["prior"].upper.tolist(),
        "factors": fields["coverage_factor"].tolist(),
        "z90": Z_90,
        "scalars": SCALARS,
        "least_share": fields["sets"].least_share_in_range if fields["sets"] else 0.0,
        "tracker": tracker_values(interface, noise, memory, length) if sets else None,
        **common,
        **sizes,
    }
    source, header = (
        environment.get_template(f"{part}.j2").render(values) for part in ("source.c", "header.h")
    )
    return CFile(source, header, **sizes)


def common_values(
    functions: Sequence[Function], shared: SharedParts, least_floats: int = 0
) -> dict[str, Any]:
    """Values for the templates of any C file, and the bytes of working arrays and constants.

    least_floats: Numbers of float that functions of the templates take of the working arrays.
    """
    lengths = {"float": least_floats} if least_floats else {}
    for function in functions:
        lengths |= {k: max(n, lengths.get(k, 0)) for k, n in function.lengths.items()}
    constants = shared.used_in("\n".join(function.text for function in functions))
    return {
        "functions": functions,
        "arrays": {ARRAYS[kind]: (kind, lengths[kind]) for kind in ARRAYS if kind in lengths},
        "constants": [array(*parts) for parts in constants],
        "kernels": kernel_texts(shared),
        "array_bytes": sum(BYTES[kind] * length for kind, length in lengths.items()),
        "constant_bytes": sum(v.size * BYTES[kind] for _, v, kind in constants),
    }


def template_environment() -> Any:
    """Jinja for the templates of C files, with a filter for numbers of float."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters["float"] = lambda x: number(x, "float")
    environment.filters["elements"] = prod
    environment.filters["constant_array"] = _constant_array
    environment.filters["floats"] = lambda many: ", ".join(number(x, "float") for x in many)
    return environment


def single_function(model: Any, shared: SharedParts, name: str) -> Function:
    """The estimate from one row, for a prefix of C names."""
    known = {SET_SWITCH: Tensor.constant(np.zeros(1, np.bool_))}
    nodes = flat_nodes(model.graph, known)
    inputs = {
        key: Tensor(f"(&row->{key})", kind, (1,))
        for key, (kind, dims) in input_shapes(model).items()
        if len(dims) == 1 and key != SET_SWITCH
    }
    outputs = [o.name for o in model.graph.output if o.name in SINGLE_OUTPUTS]
    places = {output: estimate_place(output) for output in outputs}
    parameters = {
        "row": f"const {name}_row *row",
        "estimate": f"{name}_estimate *estimate",
        "work": "WORK *work",
    }
    return translate("single_graph", nodes, known, inputs, places, shared, parameters, True)


def _constant_array(values: Any, name: str) -> str:
    """The definition of an array of the template."""
    whole = np.asarray(values).dtype.kind in "iu"
    return array(name, np.asarray(values), "int" if whole else "float")


def kernel_texts(shared: SharedParts) -> list[str]:
    """Texts of the kernels of a file, each for one element type."""
    texts = {name: (KERNELS / f"{name}.c").read_text() for name, _ in shared.kernels}
    return [texts[name].replace("REAL", kind) for name, kind in sorted(shared.kernels)]
