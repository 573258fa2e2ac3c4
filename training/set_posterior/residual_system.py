"""Readings of a set as rows of one linear system, and what sensors share taken out, as a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.onnx_graph.builder import Graph
from training.set_posterior.response_surface import Response
from training.set_posterior.wheel_family import CHANNELS, CLEAR, TINY, Context, WheelFamily

#: Readings of what stands for all rows of a set, or for none: input name -> default.
READINGS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
SPREADS = ("torque_std", "torque_bias", "sinkage_std", "drawbar_pull_std")
#: Slack of the box of features that a row must lie in, as a share of its width.
SLACK = 1e-3


@dataclass(frozen=True)
class RowInputs:
    """Names of graph values: the system (readings, terms + 1), which rows are inside, how many.

    A row of the system is (a w, w g): coefficients a of a channel's polynomial less the reading, in
    standard deviations of noise, and what one standard deviation of the sensor's bias would change.
    """

    system: str
    inside: str  # (rows,) the features lie where the response was learned
    counted: str  # (3,) float32: readings that count, rows, rows inside


def draw_rows(
    graph: Graph, family: WheelFamily, response: Response, readings: dict[str, str]
) -> tuple[Context, RowInputs]:
    r"""Each row's channels as residuals that are polynomials of the unknowns.

    .. math:: e_k(x) = \frac{\sum_j a_{kj} b_j(x) - y_k}{\sqrt{\sigma_k^2 + \epsilon_k^2}}

    with y the torque as the family answers it, the logarithm of sinkage over length, or drawbar
    pull over load, and epsilon the error of the response.
    """
    op, small = graph.op, graph.small
    context = family.draw(graph, readings)
    inside = _inside(graph, response, context.features)
    # all channels together, (3, rows)
    one, sinkage = small(1.0), op("Max", readings["sinkage"], small(TINY))
    per_load = op("Div", one, readings["load"])
    gain = _stacked(graph, [context.rise, op("Div", one, sinkage), per_load])
    stray = op("Mul", _stacked(graph, [readings[f"{name}_std"] for name in CHANNELS]), gain)
    depth = op("Log", op("Div", sinkage, context.length))
    pull = op("Mul", readings["drawbar_pull"], per_load)
    y = _stacked(graph, [context.torque, depth, pull])
    counts = op("And", op("Less", stray, small([[context.clear], [CLEAR], [1e3]])), inside)
    counted = op("Cast", counts, to=1)
    total = op("Add", op("Mul", stray, stray), small(response.error[:, None] ** 2))
    weight = op("Div", counted, op("Sqrt", total))
    share = op("Mul", readings["torque_bias"], context.rise)
    bias = op("Mul", share, small([[1.0], [0.0], [0.0]]))
    both = graph.reshaped(op("Concat", y, bias, axis=0), 2, -1)
    ends = np.zeros((2, len(response.these) + 1))
    ends[0, 0], ends[1, -1] = -1.0, 1.0
    coefficients = response.draw(graph, context.features)
    off = op("Gemm", both, small(ends), coefficients, transA=1)
    scaled = op("Mul", off, graph.reshaped(weight, -1, 1))
    system = op("Compress", scaled, graph.reshaped(counts, -1), axis=0)
    sums = [
        graph.reshaped(op("ReduceSum", counted), 1),
        op("Cast", op("Shape", inside), to=1),
        op("ReduceSum", op("Cast", inside, to=1)),
    ]
    return context, RowInputs(system, inside, op("Concat", *sums, axis=0))


def _inside(graph: Graph, response: Response, features: str) -> str:
    """Whether features (rows, f) lie where the response was learned, (rows,)."""
    op, small = graph.op, graph.small
    slack = SLACK * (response.upper - response.lower)
    middle, half = 0.5 * (response.upper + response.lower), 0.5 * (response.upper - response.lower)
    off = op("Abs", op("Sub", features, small(middle)))
    beyond = op("Greater", off, small(half + slack))
    return op("Not", op("Cast", graph.reduced("ReduceMax", op("Cast", beyond, to=6), 1), to=9))


def draw_unbiased(graph: Graph, system: str, count: int) -> str:
    r"""The system (m, terms) with the sensor's bias integrated out.

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \kappa g (g^T A), \qquad
        \kappa = \frac{1}{1 + g^T g + (1 + g^T g)^{1/2}}

    for a bias whose prior is normal with standard deviation 1 in units of g. `count` terms.
    """
    op, one = graph.op, graph.small(1.0)
    sizes = graph.constant(np.asarray([count, 1], dtype=np.int64))
    a, g = graph.ops("Split", 2, system, sizes, axis=1)
    size = op("Add", op("ReduceSumSquare", g, keepdims=1), one)
    kappa = op("Add", size, op("Sqrt", size))
    along = op("Gemm", g, a, transA=1)
    return op("Gemm", op("Div", g, kappa), along, a, alpha=-1.0)


def _stacked(graph: Graph, values: list[str]) -> str:
    """Values (rows,) of each channel as rows (3, rows)."""
    return graph.reshaped(graph.op("Concat", *values, axis=0), len(values), -1)
