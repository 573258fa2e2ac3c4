"""The whole set posterior as a part of a graph: readings and memory in, answers and memory out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from training.onnx_graph.builder import Graph, Output
from training.set_posterior.importance_sampler import draw_sample
from training.set_posterior.posterior_summary import Limits, draw_answers
from training.set_posterior.residual_system import READINGS, SPREADS, draw_rows, draw_unbiased
from training.set_posterior.response_surface import Response
from training.set_posterior.wheel_family import WheelFamily


@dataclass(frozen=True)
class SetPosteriorGraph:
    """A family of wheels, how they answer, and how large the misfit of a set may be."""

    family: WheelFamily
    response: Response
    limits: Limits

    @property
    def inputs(self) -> dict[str, list[Any]]:
        """Inputs of the graph and their shapes, all float32."""
        rows: dict[str, list[Any]] = {name: ["rows"] for name in (*READINGS, *SPREADS)}
        context: dict[str, list[Any]] = {name: [1] for name in self.family.inputs()}
        memory: dict[str, list[Any]] = {
            "memory": ["kept", len(self.response.these) + 1],
            "counted": [3],
        }
        return rows | context | memory

    @property
    def outputs(self) -> dict[str, Output]:
        """Outputs of the graph."""
        q, count = self.family.targets, len(self.response.these)
        shapes: dict[str, Output] = {
            f"set_{name}": (1, [q]) for name in ("mean", "std", "low", "high")
        }
        return shapes | {
            "set_covariance": (1, [q, q]),
            "set_in_range": (9, [1]),
            "set_abstains": (9, [q]),
            "set_misfit": (1, [1]),
            "memory_out": (1, ["kept_out", count + 1]),
            "counted_out": (1, [3]),
            "row_in_range": (9, ["rows"]),
        }

    def defaults(self) -> dict[str, Any]:
        """Values of those inputs that a single reading does not bring."""
        single = np.ones(1, np.float32)
        given = {name: single for name in self.inputs if name not in ("slip", "torque", "load")}
        memory = np.zeros((0, len(self.response.these) + 1), np.float32)
        return given | {"memory": memory, "counted": np.zeros(3, np.float32)}

    def draw(self, graph: Graph, prefix: str = "") -> None:
        """Draw it; outputs are named `<prefix><output>`.

        The memory is what earlier rows of the set left: the system that they made, of which a
        triangle of as many rows as it has columns says all that it says, and three counts.
        """
        names = {name: name for name in (*READINGS, *SPREADS, *self.family.inputs())}
        context, rows = draw_rows(graph, self.family, self.response, names)
        system = graph.op("Concat", "memory", rows.system, axis=0, out=prefix + "memory_out")
        counted = graph.op("Add", "counted", rows.counted, out=prefix + "counted_out")
        graph.op("Identity", rows.inside, out=prefix + "row_in_range")
        count = len(self.response.these)
        unbiased = draw_unbiased(graph, system, count)
        sample = draw_sample(graph, self.family, self.response, context, unbiased)
        draw_answers(graph, self.family, context, sample, counted, self.limits, prefix)
