"""What the C functions of a model file take and give, from its graph and its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.errors import ModelFileError
from soilml.onboard.features import READABLE
from soilml.onboard.set_contract import (
    ABSENT_READING,
    ABSENT_STD,
    LEAST_STD,
    MEMORY_INPUTS,
    OPTIONAL_READINGS,
    RESPONSE_CHANNELS,
    SET_SWITCH,
    STD_INPUTS,
)
from training.export_c.tensor import kind_of


@dataclass(frozen=True)
class RowField:
    """A number that belongs to a row: what it must be, and what stands for it where it is NaN."""

    name: str  # input of the graph
    required: bool = False  # whether NaN is refused
    #: open interval of values
    lower: float = -np.inf
    upper: float = np.inf
    zero: bool = False  # whether zero is allowed although it is the lower end
    absent: float = np.nan  # value where nothing was measured
    reading: str = ""  # for a standard deviation: the reading that it belongs to, else empty
    #: noise of the file: constant part, and share of the reading
    constant: float = 0.0
    share: float = 0.0
    least: float = 0.0  # smallest standard deviation that the noise of the file gives
    #: for a standard deviation: its value where its reading is absent, zero if it is never
    absent_std: float = 0.0


@dataclass(frozen=True)
class ContextField:
    """A number of a whole set, its range, and what stands for it where it is NaN."""

    name: str
    lower: float
    upper: float
    default: float | None


@dataclass(frozen=True)
class Interface:
    """Inputs and outputs of a model file as the C code sees them."""

    rows: tuple[RowField, ...]  # inputs of one row, those that must be measured first
    context: tuple[ContextField, ...]  # inputs of a whole set
    #: whether the file estimates from single rows, and from sets
    single: bool
    sets: bool
    columns: int  # columns of the state of a set
    small: bool = False  # whether the file is for a microcontroller

    @property
    def precision(self) -> str:
        """C type of the numbers of a memory."""
        return "float" if self.small else "double"

    def row_number(self, name: str) -> int:
        """The place of an input of one row."""
        return [field.name for field in self.rows].index(name)

    @property
    def optional_context(self) -> bool:
        """Whether no value of a whole set must be given."""
        return all(field.default is not None for field in self.context)


def input_shapes(model: Any) -> dict[str, tuple[str, list[int | str]]]:
    """C type and dimensions of each input of a graph; variable dimensions are names."""
    return {
        info.name: (
            kind_of(info.type.tensor_type.elem_type, info.name),
            [d.dim_param or int(d.dim_value) for d in info.type.tensor_type.shape.dim],
        )
        for info in model.graph.input
    }


def read_interface(model: Any, metadata: Mapping[str, str]) -> Interface:
    """The interface of a model file; raises `ModelFileError` for inputs of another kind."""
    from onnx import numpy_helper

    shapes = input_shapes(model)
    defaults = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
    sets = json.loads(metadata["set"]) if "set" in metadata else None
    measured = [entry["name"] for entry in json.loads(metadata["inputs"])]
    rows, context = [], []
    for name, (_, dims) in shapes.items():
        if name == SET_SWITCH or name in MEMORY_INPUTS:
            continue
        if len(dims) != 1:
            raise ModelFileError(f"input {name} has {len(dims)} dimensions; needed is one")
        default = defaults.get(name)
        number = None if default is None or default.size != 1 else float(default.reshape(-1)[0])
        if isinstance(dims[0], str):
            rows.append(_row_field(name, measured, sets["noise"] if sets else {}, number))
        else:
            # what need not be given is the standard deviation of an error that all rows share, or
            # below zero by default: the size of the model's errors, which is then inferred
            free = (-np.inf if number is None else min(number, 0.0), np.inf)
            ends = sets["context"].get(name, free) if sets else free
            context.append(ContextField(name, float(ends[0]), float(ends[1]), number))
    rows.sort(key=lambda field: (not field.required, bool(field.reading)))
    columns = int(shapes[MEMORY_INPUTS[0]][1][1]) if sets else 0
    single, small = not (sets and sets["alone"]), bool(sets and sets.get("small"))
    return Interface(tuple(rows), tuple(context), single, sets is not None, columns, small)


def _row_field(
    name: str, measured: list[str], noise: Mapping[str, Any], default: float | None
) -> RowField:
    if name in measured:
        lower, upper = READABLE[name]
        return RowField(name, required=True, lower=lower, upper=upper)
    if name in OPTIONAL_READINGS:
        return RowField(name, absent=ABSENT_READING)
    if name not in STD_INPUTS and default is not None:
        return RowField(name, absent=default)
    source = name.removesuffix("_std")
    constant, share = (float(part) for part in noise.get(source, (0.0, 0.0)))
    readings = (*measured, *OPTIONAL_READINGS)
    of_channel = name.endswith("_std") and source in RESPONSE_CHANNELS
    absent_std = ABSENT_STD if source in OPTIONAL_READINGS else 0.0
    unknown = absent_std if not constant + share else 0.0
    return RowField(
        name,
        lower=0.0,
        zero=not of_channel,
        reading=next((r for r in readings if name.startswith(r)), ""),
        constant=max(constant, unknown),
        share=share,
        least=LEAST_STD if of_channel else 0.0,
        absent_std=absent_std,
    )
