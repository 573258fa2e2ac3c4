"""What a C file needs of the graph of a set posterior: functions, and values for its templates.

The composites `FirstRound`, `LikeliestSoil` and `Posterior` take all rows of a set; C has templates
for them. What is between them is translated: for one row, before and after the soil is known at
which errors are linear, and for the whole set, before and after the sample of the posterior.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from soilml.onboard.set_contract import (
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    MODEL_ERROR_COLUMNS,
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


@dataclass(frozen=True)
class SetFunctions:
    """Functions for rows and sets, and values for the template of the sampler."""

    row: Function  # columns in the middle of the prior, and what `soil` needs of a row
    set: Function  # inputs of the composites that belong to a set
    soil: Function  # columns of a row at a soil
    answer: Function  # outputs of a set
    #: what `soil` needs of a row: number of floats, and where each value begins among them
    kept: int
    places: dict[str, int]
    #: C names of the outputs of `row` and `set` by what they are
    names: dict[str, str]
    given: dict[str, str]  # C expressions of values that composites make
    values: dict[str, Any]  # for the template


def set_functions(model: Any, interface: Interface, shared: SharedParts, rows: int) -> SetFunctions:
    """Of a model with a set posterior, for steps of so many rows.

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
    given = {
        name: Tensor(f"in_{name}", kind, (1,))
        for name, (kind, dims) in shapes.items()
        if name not in (SET_SWITCH, *MEMORY_INPUTS) and len(dims) == 1
    }
    for name in given:
        known.pop(name, None)
    of_rows = {name for name in given if isinstance(shapes[name][1][0], str)}
    of_set = {name: tensor for name, tensor in given.items() if name not in of_rows}
    counted = next(n.output[0] for n in nodes if MEMORY_OUTPUTS[1] in n.output[0])
    basis = (likeliest or found[FIRST]).output[0]
    terms = interface.columns - len(SENSOR_ERROR_COLUMNS) - len(MODEL_ERROR_COLUMNS)
    soil = Tensor("in_soil", "float", (terms, 1))
    # values that follow from the readings of a row, and from the soil as well
    composites = [node for node in nodes if node.op_type in (SOUND, FIRST, LIKELIEST, POSTERIOR)]
    others = [node for node in nodes if node not in composites and counted not in node.output]
    row_values = _following(others, of_rows)
    soil_values = _following(others, {basis})
    live = {
        name
        for node in others
        if soil_values & set(node.output)
        for name in node.input
        if name in row_values and name not in soil_values
    }
    own = {found[SOUND].output[1]: Tensor.constant(np.zeros(3, np.float32))}
    names = {
        "columns": first["columns"], "used": first["used"], "in_range": ROW_IN_RANGE,
        "counted": counted,
    }  # fmt: skip
    row = translate(
        "row_graph", nodes, known, {**given, **own},
        [*names.values(), *sorted(live)], shared,
    )  # fmt: skip
    if row.outputs[first["columns"]][1][0] != CHANNELS:
        raise ModelFileError(EARLIER)
    kept = {name: Tensor(f"in_{name}", *row.outputs[name]) for name in sorted(live)}
    if wrong := [name for name, tensor in kept.items() if tensor.kind != "float"]:
        raise ModelFileError(f"value {wrong[0]} of a row is not float32")
    starts = np.cumsum([0, *(tensor.count for tensor in kept.values())])
    inputs = {basis: soil, **kept, **of_set}
    at_soil = translate("soil_graph", nodes, known, inputs, [posterior["columns"]], shared)
    total = {counted: Tensor("in_counted", "float", (3,))}
    of_composites = {"limit": posterior["limit"], "size": posterior["size"]}
    if "unknowns" in first:
        of_composites["unknowns"] = first["unknowns"]
    if likeliest is not None:
        of_composites["std"] = _arguments(model, likeliest)["std"]
    whole = translate(
        "set_graph", nodes, known, {**of_set, **total}, of_composites.values(), shared
    )
    sizes = _values(known, first, posterior, interface, rows, nodes, likeliest, model)
    points = sizes["POINTS"]
    sample = dict(
        zip(
            found[POSTERIOR].output,
            (
                Tensor("in_points", "float", (1 + sizes["UNKNOWNS"], points)),
                Tensor("in_weights", "float", (1, points)),
                Tensor("in_misfit", "float", (1,)),
            ),
            strict=False,
        )
    )
    outputs = [o.name for o in model.graph.output if o.name.startswith(SET_PREFIX)]
    answer = translate("answer_graph", nodes, known, {**of_set, **total, **sample}, outputs, shared)
    of_c = {basis: "work->soil", counted: "work->counted"}
    of_c |= {n: f"work->{t.name.removeprefix('in_')}" for n, t in sample.items()}
    return SetFunctions(
        row, whole, at_soil, answer, int(starts[-1]),
        dict(zip(kept, starts.tolist(), strict=False)), names | of_composites, of_c, sizes,
    )  # fmt: skip


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


def work_fields(functions: SetFunctions, columns: int, rows: int) -> dict[str, int]:
    """Numbers of float of the members of the working memory that the sampler needs, by name."""
    v = functions.values
    first, most = v["FIRST"], max(v["WIDTH"], columns, 2 * v["ERRORS"] + 7)
    return {
        "change": most, "squares": v["WIDTH"],
        "monomials": max(v["TERMS"], v["ERRORS"]) * v["TILE"],
        "points": (1 + v["UNKNOWNS"]) * v["POINTS"], "weights": v["POINTS"],
        "soil": v["MONOMIALS"], "unknowns": v["MONOMIALS"] * (v["TERMS"] + v["LINEAR"])
        if v["LINEAR"] else v["MONOMIALS"], "std": max(v["LINEAR"], 1),
        "drawn": first, "outside": first, "log_weight": first, "least": first, "first_least": first,
        "total": first, "parts": v["SCALES"] * first, "of_scale": v["SCALES"],
        "whitening": v["SCALES"] * v["ERRORS"] ** 2,
        "mean": v["ERRORS"] * max(v["WIDTH"], 2 * v["ERRORS"] + 7),
        "unbounded": max(v["UNKNOWNS"] - 1, 1) * v["ADAPTED"],
        "kept": rows * functions.kept, "fresh": CHANNELS * rows * columns,
    }  # fmt: skip


def shared_floats(functions: SetFunctions) -> int:
    """Numbers of float of the system and of coefficients, which functions share."""
    v = functions.values
    tiles = (2 * v["ERRORS"] + v["REST"]) * v["POWERS"] * v["TILE"]
    return int(v["MOST_ROWS"] * v["WIDTH"] + tiles)
