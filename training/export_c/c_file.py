"""A model file as a C file and its header."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.onboard.metadata import read_fields
from soilml.onboard.set_contract import (
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    SET_PREFIX,
    SET_SWITCH,
)
from soilml.onboard.tracking.soil_tracker import DEFAULT_LENGTH
from soilml.quantities import NOT_IDENTIFIED_ABOVE, Z_90
from training.export_c.c_text import array, number, wrapped
from training.export_c.interface import Interface, input_shapes, read_interface
from training.export_c.program import ARRAYS, Function, SharedParts
from training.export_c.set_functions import set_functions, shared_floats, work_fields
from training.export_c.single_precision import in_single_precision
from training.export_c.tensor import Tensor
from training.export_c.tracker import tracker_values
from training.export_c.translation import flat_nodes, translate, with_templates

#: Bytes of an element, as all usual compilers have them; the C file checks what follows from it.
BYTES = {"double": 8, "float": 4, "int": 4, "bool": 1}
#: Rows that one call takes, unless the user wants another number.
ROWS_PER_CALL = 32
CRC_BYTES = 4096  # Of the tables of a checksum, which files for a microcontroller do without
TEMPLATES = Path(__file__).parent / "templates"
KERNELS = TEMPLATES / "kernels"
#: Functions of the C library in the kernels, by element type.
_MATH = {
    "EXP": {"float": "expf", "double": "exp"},
    "LEAST_POWER": {"float": "-87.0f", "double": "-708.0"},
}
#: Entries of the metadata that tell one file from another, and what they were trained from.
IDENTITY = ("graph_sha256", "metadata_sha256", "data_sha256", "recipe_sha256", "spec_sha256")
#: Outputs that are one number for a row or set; others have one for each estimated quantity, or for
#: each pair of them.
SCALARS = ("in_range", "misfit")
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
    single = single_function(model, shared) if interface.single else None
    sets = set_functions(model, interface, shared, rows) if interface.sets else None
    functions = [single] if single else []
    functions += [sets.row, sets.set, sets.once, sets.soil, sets.answer] if sets else []
    arrays = {
        name: (kind, max(f.lengths.get(kind, 0) for f in functions))
        for kind, name in ARRAYS.items()
        if any(kind in f.lengths for f in functions)
    }
    members: dict[str, int] = {}
    constants = shared.used_in("\n".join(function.text for function in functions))
    if sets:
        shared.kernel("tanh_of", "float")
        arrays["floats"] = "float", max(arrays["floats"][1], shared_floats(sets))
        members = work_fields(sets, interface.columns, rows)
    work = sum(BYTES[kind] * length for kind, length in arrays.values())
    work += 4 * sum(members.values())
    of_sampler = sum(np.size(x) for x in sets.values["arrays"].values()) if sets else 0
    if interface.sets:
        work += len(interface.rows) * rows * 4 + interface.columns * BYTES[interface.precision] + 40
    triangle = interface.columns * (interface.columns + 1) // 2
    memory = triangle * BYTES[interface.precision] + (4 + len(interface.context)) * 4 + 24
    sizes = {
        "memory_bytes": -(-memory // 8) * 8 if interface.sets else 0,
        "work_bytes": -(-work // 8) * 8,
        "constant_bytes": sum(v.size * BYTES[kind] for _, v, kind in constants)
        + 4 * of_sampler
        + (CRC_BYTES if interface.sets and not interface.small else 0),
    }
    environment = template_environment()
    environment.filters["scalar"] = lambda output: output.removeprefix(SET_PREFIX) in SCALARS
    fields = read_fields(metadata)
    values = {
        "name": name,
        "NAME": name.upper(),
        "origin": origin,
        "version": __version__,
        "model_version": metadata["soilml_version"],
        "identity": {key: metadata[key] for key in IDENTITY if key in metadata},
        "noise": fields["sets"].noise if fields["sets"] else {},
        "sha": metadata["graph_sha256"],
        "codes": CODES,
        "interface": interface,
        "functions": functions,
        "single": single,
        "sets": sets,
        "sampler": sets.values if sets else {},
        "arrays": arrays,
        "members": members,
        "constants": [array(*parts) for parts in constants],
        "kernels": kernel_texts(shared),
        "rows": rows,
        "quantities": list(zip(fields["names"], fields["units"], strict=True)),
        "lower": fields["prior"].lower.tolist(),
        "upper": fields["prior"].upper.tolist(),
        "factors": fields["coverage_factor"].tolist(),
        "z90": Z_90,
        "vague": NOT_IDENTIFIED_ABOVE,
        "exact_columns": _exact_columns(interface),
        "least_share": fields["sets"].least_share_in_range if fields["sets"] else 0.0,
        "tracker": tracker_values(interface, sizes["memory_bytes"], length) if sets else None,
        **sizes,
    }
    source, header = (
        environment.get_template(f"{part}.j2").render(values) for part in ("source.c", "header.h")
    )
    return CFile(source, header, **sizes)


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
    environment.globals["crc_tables"] = [[f"{x:#x}u" for x in own] for own in _crc_tables()]
    environment.filters["float"] = lambda x: number(x, "float")
    environment.filters["elements"] = prod
    environment.filters["wrapped"] = lambda text, indent: "\n".join(wrapped(text, indent))
    environment.filters["constant_array"] = _constant_array
    environment.filters["floats"] = lambda many: ", ".join(number(x, "float") for x in many)
    return environment


def _crc_tables() -> list[list[int]]:
    """Four tables (256,) of CRC-32: of a byte, and of one with up to three zeros behind it."""
    first = []
    for crc in range(256):
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
        first.append(crc)
    tables = [first]
    while len(tables) < CRC_BYTES // 1024:
        tables.append([x >> 8 ^ first[x & 255] for x in tables[-1]])
    return tables


def single_function(model: Any, shared: SharedParts) -> Function:
    """The estimate from one row."""
    known = {SET_SWITCH: Tensor.constant(np.zeros(1, np.bool_))}
    nodes = flat_nodes(model.graph, known)
    inputs = {
        name: Tensor(f"in_{name}", kind, (1,))
        for name, (kind, dims) in input_shapes(model).items()
        if len(dims) == 1 and name != SET_SWITCH
    }
    outputs = [o.name for o in model.graph.output if o.name in SINGLE_OUTPUTS]
    return translate("single_graph", nodes, known, inputs, outputs, shared)


def _constant_array(values: Any, name: str) -> str:
    """The definition of an array of the template."""
    whole = np.asarray(values).dtype.kind in "iu"
    return array(name, np.asarray(values), "int" if whole else "float")


def _exact_columns(interface: Interface) -> int:
    """Columns of a memory without errors of the model; 0 for a file whose model has none."""
    known = any(field.name == MODEL_ERROR_INPUT for field in interface.context)
    return interface.columns - len(MODEL_ERROR_COLUMNS) if interface.sets and known else 0


def kernel_texts(shared: SharedParts) -> list[str]:
    """Texts of the kernels of a file, each for one element type."""
    found = []
    for name, kind in sorted(shared.kernels):
        text = (KERNELS / f"{name}.c").read_text()
        for mark, functions in _MATH.items():
            text = text.replace(mark, functions.get(kind, mark))
        found.append(text.replace("REAL", kind))
    return found
