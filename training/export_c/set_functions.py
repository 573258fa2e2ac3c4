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


class _SetGraph:
    """The graph of a set posterior between its composites, and where C has its values.

    Raises `ModelFileError` for a graph without the composites: one of an earlier version.
    """

    def __init__(self, model: Any, interface: Interface, shared: SharedParts, name: str) -> None:
        shapes, kinds = input_shapes(model), (SOUND, FIRST, LIKELIEST, POSTERIOR)
        self.known = {SET_SWITCH: Tensor.constant(np.ones(1, np.bool_))}
        self.nodes, self.shared = flat_nodes(model.graph, self.known), shared
        self.calls = {node.op_type: node for node in self.nodes if node.op_type in kinds}
        if not {SOUND, FIRST, POSTERIOR} <= {*self.calls}:
            raise ModelFileError(EARLIER)
        inputs = {f.name: f.input for f in model.functions}
        #: what each composite is given, by the names in it
        self.given = {
            kind: dict(zip(inputs[kind], node.input, strict=True))
            for kind, node in self.calls.items()
        }
        self.of_rows = {
            field.name: Tensor(f"(&work->readings[{k}][r])", shapes[field.name][0], (1,))
            for k, field in enumerate(interface.rows)
        }
        self.of_set = {
            field.name: Tensor(f"(&memory->context.{field.name})", shapes[field.name][0], (1,))
            for field in interface.context
        }
        # which a check leaves out
        self.of_set[MODEL_ERROR_INPUT] = Tensor("work->size", "float", (1,))
        for fed in (*self.of_rows, *self.of_set):
            self.known.pop(fed, None)
        self.counted = next(n.output[0] for n in self.nodes if MEMORY_OUTPUTS[1] in n.output[0])
        self.outputs = [o.name for o in model.graph.output if o.name.startswith(SET_PREFIX)]
        terms = interface.columns - len(SENSOR_ERROR_COLUMNS) - len(MODEL_ERROR_COLUMNS)
        soil = self.calls.get(LIKELIEST, self.calls[FIRST]).output[0]
        self.soil = {soil: Tensor("work->soil", "float", (terms, 1))}
        self.parameters = {
            "memory": f"const {name}_memory *memory", "r": "int r",
            "estimate": f"{name}_set_estimate *estimate", "work": "WORK *work",
        }  # fmt: skip

    def function(
        self,
        name: str,
        inputs: Mapping[str, Tensor],
        outputs: Mapping[str, str],
        checked: bool = False,
    ) -> Function:
        """A function of these inputs and those of a set; see `translate`."""
        return translate(
            name, self.nodes, self.known, {**inputs, **self.of_set}, outputs, self.shared,
            self.parameters, checked,
        )  # fmt: skip

    def constant(self, kind: str, argument: str) -> NDArray[Any]:
        """The value of a constant that a composite is given."""
        from onnx import numpy_helper

        own = self.given[kind][argument]
        tensor = self.known.get(own)
        if tensor is not None and tensor.value is not None:
            return tensor.value
        node = next(n for n in self.nodes if n.op_type == "Constant" and own in n.output)
        return numpy_helper.to_array(node.attribute[0].t)

    def values_at_soil(self) -> tuple[list[str], list[str]]:
        """What columns at a soil need: values of each row, and values of the soil alone."""
        composites = list(self.calls.values())
        others = [n for n in self.nodes if n not in composites and self.counted not in n.output]
        row_values, soil_values = (_following(others, own) for own in (self.of_rows, self.soil))
        of_soil = [node for node in others if soil_values & {*node.output}]
        of_rows = {n for node in of_soil for n in node.input if n in row_values - soil_values}
        of_both = [node for node in of_soil if row_values & {*node.output}]
        alone = soil_values - row_values - {*self.soil}
        return sorted(of_rows), sorted({n for node in of_both for n in node.input if n in alone})


def set_functions(
    model: Any, interface: Interface, shared: SharedParts, rows: int, name: str
) -> SetFunctions:
    """Of a model with a set posterior, for steps of so many rows and a prefix of C names.

    Raises `ModelFileError` for a graph without the composites: one of an earlier version.
    """
    graph = _SetGraph(model, interface, shared, name)
    first, posterior = graph.given[FIRST], graph.given[POSTERIOR]
    kept, of_all = (
        {value: f"{member}_{k}" for k, value in enumerate(values)}
        for member, values in zip(("of_rows", "of_soil"), graph.values_at_soil(), strict=True)
    )
    no_counts = {graph.calls[SOUND].output[1]: Tensor.constant(np.zeros(3, np.float32))}
    places = {
        first["columns"]: "work->of_row", first["used"]: "work->used[r]",
        ROW_IN_RANGE: "(work->inside + r)", graph.counted: "work->of_counts",
    }  # fmt: skip
    places |= {value: f"work->{member}[r]" for value, member in kept.items()}
    row = graph.function("row_graph", {**graph.of_rows, **no_counts}, places)
    channels, row_columns = row.outputs[first["columns"]][1]
    if channels != CHANNELS:
        raise ModelFileError(EARLIER)
    if wrong := [value for value in kept if row.outputs[value][0] != "float"]:
        raise ModelFileError(f"value {wrong[0]} of a row is not float32")
    places = {value: f"work->{member}" for value, member in of_all.items()}
    once = graph.function("once_graph", graph.soil, places)
    at_soil = {v: Tensor(f"work->{m}[r]", *row.outputs[v]) for v, m in kept.items()}
    at_soil |= {v: Tensor(place, *once.outputs[v]) for v, place in places.items()}
    columns = {posterior["columns"]: "work->of_row"}
    soil = graph.function("soil_graph", {**graph.soil, **at_soil}, columns)
    total = {graph.counted: Tensor("work->counted", "float", (3,))}
    places = {posterior["limit"]: "work->limit", posterior["size"]: "work->size"}
    if LIKELIEST in graph.given:
        places[graph.given[LIKELIEST]["std"]] = "work->std"
    whole = graph.function("set_graph", total, places)
    values = _values(graph, interface, rows)
    points = values["POINTS"]
    shapes = {"points": (1 + values["UNKNOWNS"], points), "weights": (1, points), "misfit": (1,)}
    sample = {
        value: Tensor(f"work->{member}", "float", shape)
        for value, (member, shape) in zip(
            graph.calls[POSTERIOR].output, shapes.items(), strict=False
        )
    }
    places = {output: estimate_place(output.removeprefix(SET_PREFIX)) for output in graph.outputs}
    answer = graph.function("answer_graph", {**total, **sample}, places, checked=True)
    members: dict[str, tuple[int, ...]] = {
        **{m: (rows, prod(row.outputs[v][1])) for v, m in kept.items()},
        **{m: (prod(once.outputs[v][1]),) for v, m in of_all.items()},
        **_work_members(values, interface.columns, rows),
    }
    return SetFunctions(row, whole, once, soil, answer, row_columns, members, values)


def estimate_place(output: str) -> str:
    """Where an output lies in the struct of an estimate."""
    return f"{'&' if output in SCALARS else ''}estimate->{output}"


def _following(nodes: Sequence[Any], names: Iterable[str]) -> set[str]:
    """Values that follow from some, these among them."""
    found = set(names)
    for node in nodes:
        if found & set(node.input):
            found |= set(node.output)
    return found


def _values(graph: _SetGraph, interface: Interface, rows: int) -> dict[str, Any]:
    """Sizes, which are macros of C, and constant arrays for the template of the sampler."""
    of_first, of_posterior = (partial(graph.constant, kind) for kind in (FIRST, POSTERIOR))
    factors = of_first("terms")
    unknowns = len(of_first("tilts"))
    powers = (factors == unknowns).sum(axis=1)
    order = np.argsort(powers, kind="stable")
    others = np.where(factors == unknowns, 0, factors)[order]
    present = of_posterior("present")
    zs = len(graph.constant(LIKELIEST, "powers")) if LIKELIEST in graph.given else 0
    sizes = {
        "CHANNELS": CHANNELS,
        "MONOMIALS": interface.columns - len(SENSOR_ERROR_COLUMNS) - len(MODEL_ERROR_COLUMNS),
        "TERMS": len(order),
        "POWERS": int(powers.max()) + 1,
        "UNKNOWNS": unknowns,
        "DEGREE": factors.shape[1],
        "FIRST": of_first("draws").shape[1],
        "ADAPTED": of_posterior("normal").shape[1],
        "ROUNDS": int(of_posterior("rounds").flat[0]),
        "SENSORS": len(SENSOR_ERROR_COLUMNS),
        "MODEL_ERRORS": len(MODEL_ERROR_COLUMNS),
        "LINEAR": zs,
        "ERRORS": len(present),
        "SCALES": len(of_posterior("scales")),
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
        "prior_draws": of_first("draws"), "prior_t": of_first("t"),
        "log_prior": of_first("log_prior"), "adapted_draws": of_posterior("normal"),
        "adapted_t": of_posterior("t"), "log_density": of_posterior("log_density"),
        "error_scales": of_posterior("scales"), "tilts": of_first("tilts"),
        "log_probabilities": of_posterior("log_probabilities"),
    }  # fmt: skip
    if zs:
        part, *of_z = (
            graph.constant(LIKELIEST, name) for name in ("part", "powers", "derivatives")
        )
        arrays["sampled_part"] = np.argsort(order)[part]
        arrays |= dict(zip(("linear_powers", "linear_derivatives"), of_z, strict=True))
        del arrays["column_of"]
    numbers = {name.lower(): number for name, number in vars(sampler).items() if name.isupper()} | {
        "targets": int(of_posterior("targets").flat[0]), "damping": sampler.DAMPING_STD**-2,
        "least_jacobian": 1.0 - LARGEST_TANH**2,
    }  # fmt: skip
    return sizes | {"arrays": arrays, "numbers": numbers}


def _work_members(values: Mapping[str, Any], columns: int, rows: int) -> dict[str, tuple[int, ...]]:
    """Members of the working memory that the sampler needs, of float, with their sizes."""
    v = values
    first, most = v["FIRST"], max(v["WIDTH"], columns, 2 * v["ERRORS"] + 7)
    numbers = {
        "of_row": CHANNELS * columns, "of_counts": 3, "counted": 3, "limit": 1, "size": 1,
        "misfit": 1, "change": most, "squares": v["WIDTH"],
        "monomials": max(v["TERMS"], v["ERRORS"]) * v["TILE"],
        "points": (1 + v["UNKNOWNS"]) * v["POINTS"], "weights": v["POINTS"],
        "soil": v["MONOMIALS"], "drawn": first, "outside": first, "log_weight": first,
        "least": first, "first_least": first, "total": first,
        "parts": v["SCALES"] * first, "of_scale": v["SCALES"],
        "whitening": v["SCALES"] * v["ERRORS"] ** 2,
        "mean": v["ERRORS"] * max(v["WIDTH"], 2 * v["ERRORS"] + 7),
        "unbounded": max(v["UNKNOWNS"] - 1, 1) * v["ADAPTED"], "fresh": CHANNELS * rows * columns,
    }  # fmt: skip
    if zs := v["LINEAR"]:
        numbers |= {"of_z": v["MONOMIALS"], "changes": zs * v["MONOMIALS"], "unit": zs, "std": zs}
    return {member: (count,) for member, count in numbers.items()}


def shared_floats(values: Mapping[str, Any]) -> int:
    """Numbers of float of the system and of coefficients, which functions share."""
    v = values
    tiles = (2 * v["ERRORS"] + v["REST"]) * v["POWERS"] * v["TILE"]
    return int(v["MOST_ROWS"] * v["WIDTH"] + tiles)
