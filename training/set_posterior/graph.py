"""The whole set posterior as part of a graph: readings and memory in, estimates and memory out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.onboard.set_contract import (
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    READING_INPUTS,
    REQUIRED_READINGS,
    ROW_IN_RANGE,
    SET_PREFIX,
    STD_INPUTS,
    empty_memory,
)
from training.onnx_graph.builder import BOOL, FLOAT, Graph, Output
from training.onnx_graph.value import Value, concat
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.response_surface import Response
from training.set_posterior.sampler.importance_sampler import add_importance_sampler
from training.set_posterior.sampler.misfit_test import MisfitLimits
from training.set_posterior.sampler.posterior_summary import add_posterior_outputs
from training.set_posterior.sampler.residual_system import add_residual_system, integrate_out_bias


@dataclass(frozen=True)
class SetPosteriorGraph:
    """A family of wheels, its response surface, and the largest accepted misfits."""

    family: WheelFamily
    response: Response
    limits: MisfitLimits

    @property
    def inputs(self) -> dict[str, list[Any]]:
        """Inputs of the graph and their shapes, all float32."""
        rows: dict[str, list[Any]] = {name: ["rows"] for name in (*READING_INPUTS, *STD_INPUTS)}
        context: dict[str, list[Any]] = {name: [1] for name in self.family.inputs()}
        shapes: tuple[list[Any], ...] = (["kept", len(self.response.terms) + 1], [3])
        return rows | context | dict(zip(MEMORY_INPUTS, shapes, strict=True))

    @property
    def outputs(self) -> dict[str, Output]:
        """Outputs of the graph."""
        q, terms = self.family.targets, len(self.response.terms)
        of_set: dict[str, Output] = {
            "mean": (FLOAT, [q]),
            "std": (FLOAT, [q]),
            "low": (FLOAT, [q]),
            "high": (FLOAT, [q]),
            "covariance": (FLOAT, [q, q]),
            "in_range": (BOOL, [1]),
            "abstains": (BOOL, [q]),
            "misfit": (FLOAT, [1]),
        }
        memory: tuple[Output, ...] = ((FLOAT, ["kept_out", terms + 1]), (FLOAT, [3]))
        return {
            **{SET_PREFIX + name: output for name, output in of_set.items()},
            **dict(zip(MEMORY_OUTPUTS, memory, strict=True)),
            ROW_IN_RANGE: (BOOL, ["rows"]),
        }

    def defaults(self) -> dict[str, Any]:
        """Values of those inputs that an estimate from single rows does not feed."""
        one = np.ones(1, np.float32)
        values = {name: one for name in self.inputs if name not in REQUIRED_READINGS}
        return values | dict(
            zip(MEMORY_INPUTS, empty_memory(len(self.response.terms)), strict=True)
        )

    def add_to(self, graph: Graph, prefix: str = "") -> None:
        """Add all nodes to a graph; outputs are named `<prefix><output>`.

        The memory is the residual system of earlier rows of the set and three counts. Its
        triangular factor, which has as many rows as columns, is equivalent to it.
        """
        names = (*READING_INPUTS, *STD_INPUTS, *self.family.inputs())
        inputs = {name: Value(graph, name) for name in (*names, *MEMORY_INPUTS)}
        context, rows = add_residual_system(self.family, self.response, inputs)
        memory, counts = (inputs[name] for name in MEMORY_INPUTS)
        outputs = [prefix + name for name in MEMORY_OUTPUTS]
        system = concat([memory, rows.system], axis=0).named(outputs[0])
        counts = (counts + rows.counts).named(outputs[1])
        rows.in_range.node("Identity").named(prefix + ROW_IN_RANGE)
        unbiased = integrate_out_bias(system, len(self.response.terms))
        sample = add_importance_sampler(self.family, self.response, context, unbiased)
        add_posterior_outputs(self.family, context, sample, counts, self.limits, prefix)
