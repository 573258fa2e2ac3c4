"""The whole set posterior as part of a graph: readings and state in, estimates and state out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    ERROR_COLUMNS,
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    OPERATING_STD_INPUTS,
    READING_INPUTS,
    ROW_IN_RANGE,
    SET_PREFIX,
    STD_INPUTS,
    empty_memory,
)
from training.onnx_graph.builder import BOOL, FLOAT, Graph, Output
from training.onnx_graph.value import Value
from training.set_posterior.draws import (
    FEW_UNKNOWNS,
    SIZES_FEW,
    SIZES_MANY,
    SIZES_SMALL,
    adapted_draws,
    prior_draws,
)
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScales
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.likelihood import Likelihood, Linear
from training.set_posterior.posterior_summary import MisfitLimits, add_posterior_outputs
from training.set_posterior.residual_system import add_residual_rows
from training.set_posterior.response_surface import Response
from training.set_posterior.row_inputs import FileNoise, complete_inputs, default_values
from training.set_posterior.sampler import Polynomials

#: Inputs of the graph with a value for each row.
ROW_INPUTS = (*READING_INPUTS, *STD_INPUTS, *OPERATING_STD_INPUTS)


@dataclass(frozen=True)
class SetPosteriorGraph:
    """A family of wheels with its response surface, and what a file assumes of readings."""

    family: WheelFamily
    response: Response  # the surface that was learned of the wheels
    limits: MisfitLimits  # largest accepted misfits
    noise: FileNoise = field(default_factory=dict)  # of the file
    small: bool = False  # for a microcontroller: fewer points, smaller systems
    scales: ErrorScales = USUAL_SCALES  # of the model's errors
    #: standard deviations of errors of the sensors that are not the family's typical ones
    sensor_errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def typical_errors(self) -> dict[str, float]:
        """Standard deviations of the errors that a set has where none are fed, by input."""
        return self.family.typical_errors() | dict(self.sensor_errors)

    @property
    def columns(self) -> int:
        """Columns of the residual system: monomials, and errors that all readings share."""
        return len(self.response.terms) + len(ERROR_COLUMNS)

    @property
    def inputs(self) -> dict[str, list[Any]]:
        """Inputs of the graph and their shapes, all float32."""
        rows: dict[str, list[Any]] = {name: ["rows"] for name in ROW_INPUTS}
        of_set = (*self.family.inputs(), *COMMON_ERROR_INPUTS)
        context: dict[str, list[Any]] = {name: [1] for name in of_set}
        shapes: tuple[list[Any], ...] = (["kept", self.columns], [3])
        return rows | context | dict(zip(MEMORY_INPUTS, shapes, strict=True))

    @property
    def outputs(self) -> dict[str, Output]:
        """Outputs of the graph."""
        q = self.family.targets
        of_set: dict[str, Output] = {
            **{name: (FLOAT, [q]) for name in ("mean", "std", "low", "high")},
            "covariance": (FLOAT, [q, q]),
            "in_range": (BOOL, [1]),
            **{name: (BOOL, [q]) for name in ("abstains", "at_edge")},
            "misfit": (FLOAT, [1]),
        }
        state: tuple[Output, ...] = ((FLOAT, ["kept_out", self.columns]), (FLOAT, [3]))
        return {
            **{SET_PREFIX + name: output for name, output in of_set.items()},
            **dict(zip(MEMORY_OUTPUTS, state, strict=True)),
            ROW_IN_RANGE: (BOOL, ["rows"]),
        }

    def defaults(self) -> dict[str, Any]:
        """Values of inputs that need not be fed: not measured, the file's noise, typical errors.

        Context inputs have none, and the state is empty.
        """
        errors = self.typical_errors.items()
        values = default_values() | {k: np.full(1, v, np.float32) for k, v in errors}
        return values | dict(zip(MEMORY_INPUTS, empty_memory(self.columns), strict=True))

    def add_to(self, graph: Graph, prefix: str = "") -> None:
        """Add all nodes to a graph; outputs are named `<prefix><output>`.

        The state is the residual system of earlier rows of the set and three counts. Its
        triangular factor, which has as many rows as columns, is equivalent to it.
        """
        of_set = (*self.family.inputs(), *COMMON_ERROR_INPUTS)
        names = (*ROW_INPUTS, *of_set, *MEMORY_INPUTS)
        inputs = {name: Value(graph, name) for name in names}
        positive = [name for name, (least, _) in self.family.limits().items() if least > 0.0]
        inputs = complete_inputs(inputs, of_set, self.noise, positive)
        rows = add_residual_rows(self.family, self.response, inputs)
        state, counts = (inputs[name] for name in MEMORY_INPUTS)
        outputs = [prefix + name for name in MEMORY_OUTPUTS]
        counts = (counts + rows.counts).named(outputs[1])
        rows.in_range.node("Identity").named(prefix + ROW_IN_RANGE)

        family, terms, std = self.family, self.response.terms, rows.context.axis_std
        nearly = None if std is None else Linear.of(terms, family.free, std)
        axes = family.axes[: family.free]
        usual = family.model_errors()
        polynomials = Polynomials.of(axes, terms if nearly is None else nearly.sampled)
        consistency = self.limits.of_set(counts)
        sizes = SIZES_FEW if len(axes) <= FEW_UNKNOWNS else SIZES_MANY
        sizes = SIZES_SMALL if self.small else sizes
        likelihood = Likelihood(
            polynomials, rows, state, inputs[MODEL_ERROR_INPUT], self.scales,
            tuple(usual[name] > 0.0 for name in MODEL_ERROR_COLUMNS), nearly, sizes, family.targets,
        )  # fmt: skip
        *sample, grown = likelihood.sampled(
            prior_draws(graph, axes, polynomials.order, sizes.prior),
            adapted_draws(graph, polynomials.unknowns, sizes.adapted), consistency[0],
        )  # fmt: skip
        grown.node("Identity").named(outputs[0])
        add_posterior_outputs(
            family, polynomials.order, rows.context, sample, consistency, prefix, self.small
        )
