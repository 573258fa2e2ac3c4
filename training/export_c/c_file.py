"""A model file as a C file and its header."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from soilml import __version__
from soilml.onboard.metadata import read_fields
from soilml.onboard.set_contract import (
    MEMORY_INPUTS,
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    SET_PREFIX,
)
from soilml.onboard.tracking.soil_tracker import DEFAULT_LENGTH
from soilml.quantities import NOT_IDENTIFIED_ABOVE, Z_90
from training.export_c.c_text import array, number
from training.export_c.functions import (
    GraphFunction,
    answer_function,
    single_function,
    step_function,
    update_function,
)
from training.export_c.graph_translation import rows_are_apart
from training.export_c.interface import Interface, read_interface
from training.export_c.operators.together import FEW_ROWS
from training.export_c.program import Constant, SharedParts
from training.export_c.single_precision import in_single_precision
from training.export_c.stage_text import ARRAYS, WIDTH
from training.export_c.tracker import tracker_values

#: Bytes of an element, as all usual compilers have them; the C file checks what follows from it.
BYTES = {"double": 8, "float": 4, "int": 4, "bool": 1}
#: Rows that one call takes, unless the user wants another number.
ROWS_PER_CALL = 32
TEMPLATES = Path(__file__).parent / "templates"
KERNELS = TEMPLATES / "kernels"
LIGHT = KERNELS / "light"  # Versions for a processor without vector instructions
#: Functions of the C library in the kernels, by element type.
_MATH = {
    "EXP": {"float": "expf", "double": "exp"},
    "SQRT": {"float": "sqrtf", "double": "sqrt"},
    "FEW_ROWS": {"float": str(FEW_ROWS), "double": str(FEW_ROWS)},
    "LEAST_REST": {"float": "1e-7f", "double": "1e-7"},
    "LEAST_POWER": {"float": "-87.0f", "double": "-708.0"},
    "REDUCED": {"float": "1e-3f", "double": "1e-3"},
}
#: Kernels that others call, where these have no light version; of others, one that calls another
#: has a name after it.
CALLED = {
    "add_product": ("add_product_transposed",),
    "factor_rows": ("largest_column", "reflect"),
    "integrate_out": ("sum_of_rows",),
    "reflect": ("sum_of_rows",),
    "tanh_of": ("at_least", "at_most"),
}
#: Entries of the metadata that tell one file from another, and what they were trained from.
IDENTITY = ("graph_sha256", "metadata_sha256", "data_sha256", "recipe_sha256", "spec_sha256")
#: Outputs that are one number for a row or set; others have one for each estimated quantity, or for
#: each pair of them.
SCALARS = ("in_range", "misfit")


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
    model = in_single_precision(model, metadata)
    interface, shared = read_interface(model, metadata), SharedParts()
    functions: dict[str, GraphFunction] = {}
    depends = False
    if interface.single:
        functions["single"] = single_function(model, interface, shared)
    if interface.sets:
        if rows_are_apart(model):
            functions["step"] = step_function(model, interface, shared, rows)
        else:
            functions["update"] = update_function(model, interface, shared, rows)
            depends = True
        functions["answer"] = answer_function(model, interface, shared, rows)
    used = frozenset().union(*(function.constants for function in functions.values()))
    constants = [parts for parts in shared.constants.values() if parts[0] in used]
    environment = template_environment()
    environment.filters["scalar"] = lambda output: output.removeprefix(SET_PREFIX) in SCALARS
    environment.globals["arguments"] = partial(_arguments, interface)
    sizes = _sizes(interface, functions, constants, rows)
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
        "interface": interface,
        "functions": functions,
        "arrays": _arrays(functions),
        "constants": [array(*parts) for parts in constants],
        "kernels": kernel_texts(shared, interface.small),
        "unpacking": sorted(shared.unpacking),
        "rows": rows,
        "quantities": list(zip(fields["names"], fields["units"], strict=True)),
        "lower": fields["prior"].lower.tolist(),
        "upper": fields["prior"].upper.tolist(),
        "factors": fields["pooling"].single_row_coverage_factor.tolist(),
        "z90": Z_90,
        "vague": NOT_IDENTIFIED_ABOVE,
        "exact_columns": _exact_columns(interface),
        "least_share": fields["sets"].least_share_in_range if fields["sets"] else 0.0,
        "tracker": tracker_values(interface, sizes["memory_bytes"], length) if depends else None,
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
    environment.filters["float"] = lambda x: number(x, "float")
    environment.filters["floats"] = lambda many: ", ".join(number(x, "float") for x in many)
    return environment


def _arrays(functions: Mapping[str, GraphFunction]) -> dict[str, tuple[str, int]]:
    """Arrays of the working memory, which all functions share: type and length by name."""
    return {
        name: (kind, max(f.lengths.get(kind, 0) for f in functions.values()))
        for kind, name in ARRAYS.items()
        if any(kind in f.lengths for f in functions.values())
    }


def _sizes(
    interface: Interface,
    functions: Mapping[str, GraphFunction],
    constants: Sequence[Constant],
    rows: int,
) -> dict[str, int]:
    """Bytes of the structs that a user allocates, rounded up to a double."""
    work = sum(BYTES[kind] * length for kind, length in _arrays(functions).values())
    if interface.sets:
        work += len(interface.rows) * rows * BYTES["float"]
        work += interface.columns * BYTES[interface.precision] + 24  # rows that were added last
    triangle = interface.columns * (interface.columns + 1) // 2
    precision, shared = BYTES[interface.precision], 4 + len(interface.context)
    memory = triangle * precision + shared * BYTES["float"] + 24
    return {
        "memory_bytes": -(-memory // 8) * 8 if interface.sets else 0,
        "work_bytes": -(-work // 8) * 8,
        "constant_bytes": sum(values.size * BYTES[kind] for _, values, kind in constants),
    }


def _exact_columns(interface: Interface) -> int:
    """Columns of a memory without errors of the model; 0 for a file whose model has none."""
    known = any(field.name == MODEL_ERROR_INPUT for field in interface.context)
    return interface.columns - len(MODEL_ERROR_COLUMNS) if interface.sets and known else 0


def _arguments(
    interface: Interface, function: GraphFunction, instead: Mapping[str, str] | None = None
) -> str:
    """What a function of a set is given after its counts, as lines of C.

    instead: What it is given for some inputs in place of the memory's.
    """
    others = instead or {}
    given = [others.get(name) or _argument(interface, name) for name in function.inputs]
    given += [f"&out_{name}" for name in function.outputs]
    indent = " " * 8
    lines = textwrap.wrap(", ".join(given), WIDTH, initial_indent=indent, subsequent_indent=indent)
    return "\n" + "\n".join(lines)


def _argument(interface: Interface, name: str) -> str:
    """What a function of a set is given for an input of the graph."""
    if name == MEMORY_INPUTS[1]:
        return "memory->counted"
    for index, field in enumerate(interface.rows):
        if field.name == name:
            return f"work->readings[{index}]"
    return f"&memory->context.{name}"


def kernel_texts(shared: SharedParts, light: bool = False) -> list[str]:
    """Texts of the kernels of a file, those that others call first."""
    ordered: dict[tuple[str, str], None] = {}

    def add(name: str, kind: str) -> None:
        if not (light and LIGHT.joinpath(f"{name}.c").exists()):
            for called in CALLED.get(name, ()):
                add(called, kind)
        ordered[name, kind] = None

    for name, kind in sorted(shared.kernels):
        add(name, kind)
    texts = [kernel_text(kernel, kind, light) for kernel, kind in ordered]
    helpers = []
    for kind in ("double", "float"):
        called = [f"{name}_{kind}" for name in ("four", "plus_product")]
        for helper in [name for name in called if name in "".join(texts)]:
            helpers.append(kernel_text(helper, ""))
            if helper.startswith("four"):
                helpers.append(kernel_text("products_in_fours", kind))
    return helpers + texts


def kernel_text(name: str, kind: str, light: bool = False) -> str:
    """The text of a kernel for one element type.

    light: Whether it is for a processor without vector instructions, where there are two versions.
    """
    lighter = LIGHT / f"{name}.c"
    text = (lighter if light and lighter.exists() else KERNELS / f"{name}.c").read_text()
    for mark, functions in _MATH.items():
        text = text.replace(mark, functions.get(kind, mark))
    return text.replace("REAL", kind)
