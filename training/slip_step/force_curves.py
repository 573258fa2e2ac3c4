"""Pull and torque of a rover's wheels read off the table of forces, as nodes of a graph."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.slip_filter.filter import slip_of_ratio, travel_ratio
from soilml.slip_filter.force_table import ForceTable
from training.onnx_graph import value
from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value, absolute, concat, constant, log

RATIO_ENDS = (0.01, 10.0)  # Of rim speeds to each other


class ForceCurves:
    """Forces over the m slips of the table, at which the fastest wheel is taken.

    table: With n grounds and k wheels.
    rim, load: Rim speeds and loads (k,).
    """

    def __init__(self, graph: Graph, table: ForceTable, rim: Value, load: Value) -> None:
        self.graph, self.table, self.load = graph, table, load
        levels = len(table.load)
        fastest = rim.max(0, True)
        level = (log(load) - float(np.log(table.load[0]))) * float(
            (levels - 1) / np.log(table.load[-1] / table.load[0])
        )
        #: weights of each wheel by which the table is read: over slip (m, m), and over load (1, l)
        self.between: list[tuple[Value, Value]] = []
        for i in range(len(table.wheels)):
            travel = constant(graph, travel_ratio(table.slip)[None])
            ratio = fastest / rim.take([i], 0) * travel  # (1, m)
            slip = slip_of_ratio(ratio.clip(*RATIO_ENDS), value).clip(
                float(table.slip[0]), float(table.slip[-1])
            )
            at = absolute(level.take([i], 0) - constant(graph, np.arange(levels)[None]))
            self.between.append((_hats(graph, table.slip, slip), (1.0 - at).clip(0.0)))

    def pull(self) -> Value:
        """Pull of the rover (n, m), N."""
        total: Any = 0.0
        for i, kind in enumerate(self.table.kind):
            total = self.load.take([i], 0) * self._read(self.table.pull[kind], i) + total
        assert isinstance(total, Value)
        return total

    def torques(self, wheel: int, hot: Value) -> tuple[Value, Value]:
        """Torque of a wheel at both ends of the interval that is marked in `hot`, (n, 1) each.

        Wheels that are read one after the other share their working memory.
        """
        scale = self.load.take([wheel], 0) * float(self.table.radius[wheel])
        torque = self._read(self.table.torque[self.table.kind[wheel]], wheel)
        low, high = at_ends(torque, hot, len(self.table.slip))
        return low * scale, high * scale

    def _read(self, values: Floats, wheel: int) -> Value:
        """A table (l, n, m) at the load and the slips of a wheel, (n, m)."""
        over_slip, over_load = self.between[wheel]
        count, parts = len(self.table.values), []
        for part in (values[:, :count], values[:, count:]):
            flat = constant(self.graph, part.reshape(len(part), -1))
            parts.append((over_load @ flat).reshape(-1, len(self.table.slip)))
        soils, floors = parts  # wheels on a hard floor share its little slip
        return concat([soils @ over_slip, floors], 0)


def at_ends(values: Value, hot: Value, m: int) -> tuple[Value, Value]:
    """Values (n, m) at both ends of the interval that `hot` (n, m - 1) marks, (n, 1) each."""
    low, high = values.columns(0, m - 1), values.columns(1, m)
    return (low * hot).sum(1, True), (high * hot).sum(1, True)


def _hats(graph: Graph, nodes: Floats, places: Value) -> Value:
    """Weights (m, places) of values at nodes (m,) that interpolate linearly at places (1, .)."""
    step = np.diff(nodes)
    up = (places - constant(graph, nodes[1:-1, None])) / constant(graph, step[:-1, None]) + 1.0
    down = (constant(graph, nodes[1:-1, None]) - places) / constant(graph, step[1:, None]) + 1.0
    inner = up.node("Min", down).clip(0.0)
    begin = ((float(nodes[1]) - places) / float(step[0])).clip(0.0)
    end = ((places - float(nodes[-2])) / float(step[-1])).clip(0.0)
    return concat([begin, inner, end], 0)
