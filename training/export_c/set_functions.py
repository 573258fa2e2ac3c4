"""What a C file needs of the graph of a set posterior: functions, and values for its templates.

The composites `FirstRound`, `LikeliestSoil` and `Posterior` take all rows of a set; C has templates
for them. What is between them is translated: for one row, before and after the soil is known at
which errors are linear, and for the whole set, before and after the sample of the posterior. Each
function reads and writes members of the C structs where they lie.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from soilml.onboard.set_contract import (
    MEMORY_OUTPUTS,
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    ROW_IN_RANGE,
    SENSOR_ERROR_COLUMNS,
    SET_PREFIX,
    SET_SWITCH,
)
from training.export_c.interface import Interface, input_shapes
from training.export_c.program import Function, SharedParts
from training.export_c.tensor import Tensor
from training.export_c.translation import (
    FIRST,
    LIKELIEST,
    POSTERIOR,
    SOUND,
    flat_nodes,
    translate,
)
from training.set_posterior import sampler
from training.set_posterior.draws import LARGEST_TANH

CHANNELS = 3  # Readings of a row
EARLIER = (
    "the file is of an earlier version, whose graph has no composites, or other ones; needed is "
    "one that this version has trained"
)
#: Points of a tile, which are computed side by side; the latter where memory is scarce.
TILE, SMALL_TILE = 32, 8
FEW_ROWS = 20  # A system of so many rows is not made smaller
GRAIN = 8  # Numbers of a row of the system are a multiple of this, for vector instructions
#: Outputs that are one number for a row or set; others have one for each estimated quantity, or for
#: each pair of them.
SCALARS = ("in_range", "misfit")


@dataclass(frozen=True)
class SetFunctions:
    """Functions for rows and sets, and values for the template of the sampler."""

    row: Function  # columns in the middle of the prior, and what `soil` needs of a row
    set: Function  # inputs of the composites that belong to a set
    once: Function  # values of a soil that are the same for all rows
    soil: Function  # columns of a row at a soil
    answer: Function  # outputs of a set
    row_columns: int  # that `row` gives; the others are of errors of the model
    members: dict[str, tuple[int, ...]]  # of the working memory, of float, with their sizes
    values: dict[str, Any]  # for the template

    @property
    def all(self) -> list[Function]:
        """All functions, in the order in which they are called."""
        return [self.row, self.set, self.once, self.soil, self.answer]


def set_functions(
    model: Any, interface: Interface, shared: SharedParts, rows: int, name: str
) -> SetFunctions:
    """Of a model with a set posterior, for steps of so many rows and a prefix of C names.

    Raises `ModelFileError` for a graph without the composites: one of an earlier version.
    """
    shapes = input_shapes(model)
    known = {SET_SWITCH: Tensor.constant(np.ones(1, np.bool_))}
    nodes = flat_nodes(model.graph, known)
    found = {node.op_type: node for node in nodes if node.op_type in (SOUND, FIRST, POSTERIOR)}
    if len(found) < 3:
        raise ModelFileError(EARLIER)
    likeliest = next((node for node in nodes if node.op_type == LIKELIEST), None)
    first, posterior = (_arguments(model, found[kind]) for kind in (FIRST, POSTERIOR))
    of_rows = {
        field.name: Tensor(f"(&work->readings[{k}][r])", shapes[field.name][0], (1,))
        for k, field in enumerate(interface.rows)
    }
    of_set = {
        field.name: Tensor(f"(&memory->context.{field.name})", shapes[field.name][0], (1,))
        for field in interface.context
    }
    if MODEL_ERROR_INPUT in of_set:  # which a check leaves out
        of_set[MODEL_ERROR_INPUT] = Tensor("work->size", "float", (1,))
    for given in (*of_rows, *of_set):
        known.pop(given, None)
    counted = next(n.output[0] for n in nodes if MEMORY_OUTPUTS[1] in n.output[0])
    basis = (likeliest or found[FIRST]).output[0]
    terms = interface.columns - len(SENSOR_ERROR_COLUMNS) - len(MODEL_ERROR_COLUMNS)
    soil = Tensor("work->soil", "float", (terms, 1))
    made = partial(
        translate, nodes=nodes, known=known, shared=shared,
        parameters={
            "memory": f"const {name}_memory *memory", "r": "int r",
            "estimate": f"{name}_set_estimate *estimate", "work": "WORK *work",
        },
    )  # fmt: skip
    # values that follow from the readings of a row, and from the soil as well
    composites = [node for node in nodes if node.op_type in (SOUND, FIRST, LIKELIEST, POSTERIOR)]
    others = [node for node in nodes if node not in composites and counted not in node.output]
    row_values, soil_values = _following(others, of_rows), _following(others, {basis})
    of_soil = [node for node in others if soil_values & {*node.output}]
    live = {n for node in of_soil for n in node.input if n in row_values - soil_values}
    of_both = [node for node in of_soil if row_values & {*node.output}]
    common = {n for node in of_both for n in node.input if n in soil_values - row_values - {basis}}
    kept = {value: f"of_rows_{k}" for k, value in enumerate(sorted(live))}
    of_all = {value: f"of_soil_{k}" for k, value in enumerate(sorted(common))}
    no_counts = {found[SOUND].output[1]: Tensor.constant(np.zeros(3, np.float32))}
    row = made(
        "row_graph", inputs={**of_rows, **of_set, **no_counts},
        outputs={
            first["columns"]: "work->of_row", first["used"]: "work->used[r]",
            ROW_IN_RANGE: "(work->inside + r)", counted: "work->of_counts",
            **{value: f"work->{member}[r]" for value, member in kept.items()},
        },
    )  # fmt: skip
    channels, row_columns = row.outputs[first["columns"]][1]
    if channels != CHANNELS:
        raise ModelFileError(EARLIER)
    if wrong := [value for value in kept if row.outputs[value][0] != "float"]:
        raise ModelFileError(f"value {wrong[0]} of a row is not float32")
    places = {value: f"work->{member}" for value, member in of_all.items()}
    once = made("once_graph", inputs={basis: soil, **of_set}, outputs=places)
    rows_kept = {v: Tensor(f"work->{m}[r]", *row.outputs[v]) for v, m in kept.items()}
    soil_kept = {v: Tensor(places[v], *once.outputs[v]) for v in of_all}
    at_soil = made(
        "soil_graph", inputs={basis: soil, **rows_kept, **soil_kept, **of_set},
        outputs={posterior["columns"]: "work->of_row"},
    )  # fmt: skip
    total = {counted: Tensor("work->counted", "float", (3,))}
    of_composites = {posterior["limit"]: "work->limit", posterior["size"]: "work->size"}
    if likeliest is not None:
        of_composites[_arguments(model, likeliest)["std"]] = "work->std"
        of_composites[first["unknowns"]] = "work->unknowns"
    whole = made("set_graph", inputs={**of_set, **total}, outputs=of_composites)
    sizes = _values(known, first, posterior, interface, rows, nodes, likeliest, model)
    points = sizes["POINTS"]
    sampled = {"points": (1 + sizes["UNKNOWNS"], points), "weights": (1, points), "misfit": (1,)}
    sample = {
        value: Tensor(f"work->{member}", "float", shape)
        for value, (member, shape) in zip(found[POSTERIOR].output, sampled.items(), strict=False)
    }
    outputs = [o.name for o in model.graph.output if o.name.startswith(SET_PREFIX)]
    answer = made(
        "answer_graph", inputs={**of_set, **total, **sample}, checked=True,
        outputs={output: estimate_place(output.removeprefix(SET_PREFIX)) for output in outputs},
    )  # fmt: skip
    members: dict[str, tuple[int, ...]] = {
        **{m: (rows, prod(row.outputs[v][1])) for v, m in kept.items()},
        **{m: (prod(once.outputs[v][1]),) for v, m in of_all.items()},
        **_work_members(sizes, interface.columns, rows),
    }
    return SetFunctions(row, whole, once, at_soil, answer, row_columns, members, sizes)


def estimate_place(output: str) -> str:
    """Where an output lies in the struct of an estimate."""
    return f"{'&' if output in SCALARS else ''}estimate->{output}"


def _arguments(model: Any, node: Any) -> dict[str, str]:
    """What a call of a local function is given, by the names in the function."""
    function = next(f for f in model.functions if f.name == node.op_type)
    return dict(zip(function.input, node.input, strict=True))


def _following(nodes: Sequence[Any], names: Iterable[str]) -> set[str]:
    """Values that follow from some, these among them."""
    found = set(names)
    for node in nodes:
        if found & set(node.input):
            found |= set(node.output)
    return found


def _values(
    known: Mapping[str, Tensor], first: Mapping[str, str], posterior: Mapping[str, str],
    interface: Interface, rows: int, nodes: Sequence[Any], likeliest: Any, model: Any,
) -> dict[str, Any]:  # fmt: skip
    """Sizes, which are macros of C, and constant arrays for the template of the sampler."""
    constants = {
        name: node.attribute[0].t for node in nodes if node.op_type == "Constant"
        for name in node.output
    }  # fmt: skip

    def value(names: Mapping[str, str], name: str) -> NDArray[Any]:
        from onnx import numpy_helper

        own = names[name]
        tensor = known.get(own)
        found = tensor.value if tensor is not None else numpy_helper.to_array(constants[own])
        assert found is not None
        return found

    factors = value(first, "terms")
    unknowns = len(value(first, "tilts"))
    powers = (factors == unknowns).sum(axis=1)
    order = np.argsort(powers, kind="stable")
    others = np.where(factors == unknowns, 0, factors)[order]
    present = value(posterior, "present")
    zs: Any = value(_arguments(model, likeliest), "powers") if likeliest is not None else []
    sizes = {
        "CHANNELS": CHANNELS,
        "MONOMIALS": interface.columns - len(SENSOR_ERROR_COLUMNS) - len(MODEL_ERROR_COLUMNS),
        "TERMS": len(order),
        "POWERS": int(powers.max()) + 1,
        "UNKNOWNS": unknowns,
        "DEGREE": factors.shape[1],
        "FIRST": value(first, "draws").shape[1],
        "ADAPTED": value(posterior, "normal").shape[1],
        "ROUNDS": int(value(posterior, "rounds").flat[0]),
        "SENSORS": len(SENSOR_ERROR_COLUMNS),
        "LINEAR": len(zs),
        "ERRORS": len(present),
        "SCALES": len(value(posterior, "scales")),
        "TILE": SMALL_TILE if interface.small else TILE,
        "FEW_ROWS": len(order) if interface.small else FEW_ROWS,
    }
    columns = sizes["TERMS"] + sizes["ERRORS"] + sizes["LINEAR"] + sizes["SENSORS"]
    sizes["WIDTH"] = -(-columns // GRAIN) * GRAIN
    sizes["POINTS"] = sizes["FIRST"] + sizes["ROUNDS"] * sizes["ADAPTED"]
    sizes["MOST_ROWS"] = max(interface.columns + CHANNELS * rows, sizes["ERRORS"])
    sizes["REST"] = min(sizes["MOST_ROWS"], max(sizes["TERMS"], sizes["FEW_ROWS"]))
    arrays = {
        "column_of": order, "power_of": powers[order],
        "power_ends": np.searchsorted(powers[order], range(powers.max() + 1), "right"),
        "factor_rows": -np.sort(-others, axis=1), "present_errors": present,
        "prior_draws": value(first, "draws"), "prior_t": value(first, "t"),
        "log_prior": value(first, "log_prior"), "adapted_draws": value(posterior, "normal"),
        "adapted_t": value(posterior, "t"), "log_density": value(posterior, "log_density"),
        "error_scales": value(posterior, "scales"), "tilts": value(first, "tilts"),
        "log_probabilities": value(posterior, "log_probabilities"),
    }  # fmt: skip
    if likeliest is not None:
        given = _arguments(model, likeliest)
        named = {"sampled_part": "part", "linear_powers": "powers"}
        named |= {"linear_derivatives": "derivatives"}
        arrays |= {key: value(given, name) for key, name in named.items()}
    numbers = {name.lower(): number for name, number in vars(sampler).items() if name.isupper()} | {
        "targets": int(value(posterior, "targets").flat[0]), "damping": sampler.DAMPING_STD**-2,
        "least_jacobian": 1.0 - LARGEST_TANH**2,
    }  # fmt: skip
    return sizes | {"arrays": arrays, "numbers": numbers}


def _work_members(values: Mapping[str, Any], columns: int, rows: int) -> dict[str, tuple[int, ...]]:
    """Members of the working memory that the sampler needs, of float, with their sizes."""
    v = values
    first, most = v["FIRST"], max(v["WIDTH"], columns, 2 * v["ERRORS"] + 7)
    unknowns = v["MONOMIALS"] * (v["TERMS"] + v["LINEAR"]) if v["LINEAR"] else v["MONOMIALS"]
    numbers = {
        "of_row": CHANNELS * columns, "of_counts": 3, "counted": 3, "limit": 1, "size": 1,
        "misfit": 1, "change": most, "squares": v["WIDTH"],
        "monomials": max(v["TERMS"], v["ERRORS"]) * v["TILE"],
        "points": (1 + v["UNKNOWNS"]) * v["POINTS"], "weights": v["POINTS"],
        "soil": v["MONOMIALS"], "unknowns": unknowns, "std": max(v["LINEAR"], 1),
        "drawn": first, "outside": first, "log_weight": first, "least": first, "first_least": first,
        "total": first, "parts": v["SCALES"] * first, "of_scale": v["SCALES"],
        "whitening": v["SCALES"] * v["ERRORS"] ** 2,
        "mean": v["ERRORS"] * max(v["WIDTH"], 2 * v["ERRORS"] + 7),
        "unbounded": max(v["UNKNOWNS"] - 1, 1) * v["ADAPTED"], "fresh": CHANNELS * rows * columns,
    }  # fmt: skip
    return {member: (count,) for member, count in numbers.items()}


def shared_floats(values: Mapping[str, Any]) -> int:
    """Numbers of float of the system and of coefficients, which functions share."""
    v = values
    tiles = (2 * v["ERRORS"] + v["REST"]) * v["POWERS"] * v["TILE"]
    return int(v["MOST_ROWS"] * v["WIDTH"] + tiles)
