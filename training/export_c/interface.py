"""What the C functions of a model file take and give, from its graph and its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.errors import ModelFileError
from soilml.onboard.features import READABLE
from soilml.onboard.set_contract import MEMORY_INPUTS, SET_SWITCH
from training.export_c.tensor import kind_of
from training.set_posterior.row_inputs import MAY_BE_ZERO, ROW_STDS, reading_of


@dataclass(frozen=True)
class RowField:
    """A number that belongs to a row: what it must be, and what the graph takes where it is NaN."""

    name: str  # input of the graph
    default: float | None  # None: must be measured
    #: open interval of values
    lower: float = -np.inf
    upper: float = np.inf
    #: for a standard deviation: the reading that it belongs to, and whether it may be zero
    reading: str = ""
    may_be_zero: bool = False


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
    rows, context = [], []
    for name, (_, dims) in shapes.items():
        if name == SET_SWITCH or name in MEMORY_INPUTS:
            continue
        if len(dims) != 1:
            raise ModelFileError(f"input {name} has {len(dims)} dimensions; needed is one")
        default = defaults.get(name)
        number = None if default is None or default.size != 1 else float(default.reshape(-1)[0])
        if isinstance(dims[0], str):
            rows.append(_row_field(name, number))
        else:
            # what need not be given is the standard deviation of an error that all rows share, or
            # below zero by default: the size of the model's errors, which is then inferred
            free = (-np.inf if number is None else min(number, 0.0), np.inf)
            ends = sets["context"].get(name, free) if sets else free
            context.append(ContextField(name, float(ends[0]), float(ends[1]), number))
    rows.sort(key=lambda field: (field.default is not None, bool(field.reading)))
    columns = int(shapes[MEMORY_INPUTS[0]][1][1]) if sets else 0
    single, small = not (sets and sets["alone"]), bool(sets and sets.get("small"))
    return Interface(tuple(rows), tuple(context), single, sets is not None, columns, small)


def _row_field(name: str, default: float | None) -> RowField:
    """An input of one row; the graph's defaults stand for noise of the file, and no reading."""
    if name in ROW_STDS:
        zero = name in MAY_BE_ZERO
        return RowField(name, default, 0.0, reading=reading_of(name), may_be_zero=zero)
    free = (-np.inf, np.inf)
    return RowField(name, default, *(free if default is not None else READABLE.get(name, free)))
