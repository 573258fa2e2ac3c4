"""Readings of a set as rows of one linear system, and what sensors share taken out, as a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.graph import Graph
from training.sets.family import CHANNELS, CLEAR, Context, Family
from training.sets.response import Response

#: Readings of what stands for all rows of a set, or for none: input name -> default.
READINGS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
SPREADS = ("torque_std", "torque_bias", "sinkage_std", "drawbar_pull_std")
#: Slack of the box of features that a row must lie in, as a share of its width.
SLACK = 1e-3


@dataclass(frozen=True)
class Rows:
    """Names of graph values: the system (readings, terms + 1), which rows are inside, how many.

    A row of the system is (a w, w g): coefficients a of a channel's polynomial less the reading, in
    standard deviations of noise, and what one standard deviation of the sensor's bias would change.
    """

    system: str
    inside: str  # (rows,) the features lie where the response was learned
    counted: str  # (3,) float32: readings that count, rows, rows inside


def draw_rows(
    graph: Graph, family: Family, response: Response, readings: dict[str, str]
) -> tuple[Context, Rows]:
    r"""Each row's channels as residuals that are polynomials of the unknowns.

    .. math:: e_k(x) = \frac{\sum_j a_{kj} b_j(x) - y_k}{\sqrt{\sigma_k^2 + \epsilon_k^2}}

    with y the torque as the family answers it, the logarithm of sinkage over length, or drawbar
    pull over load, and epsilon the error of the response.
    """
    op, small = graph.op, graph.small
    context = family.draw(graph, readings)
    slack = SLACK * (response.upper - response.lower)
    inside = op(
        "And",
        op("GreaterOrEqual", context.features, small(response.lower - slack)),
        op("LessOrEqual", context.features, small(response.upper + slack)),
    )
    inside = op("Cast", graph.reduced("ReduceMin", op("Cast", inside, to=6), 1), to=9)
    torque, sinkage = (op("Max", readings[name], small(1e-12)) for name in ("torque", "sinkage"))
    shares = {
        "torque": op("Div", readings["torque_std"], torque),
        "sinkage": op("Div", readings["sinkage_std"], sinkage),
        "drawbar_pull": op("Div", readings["drawbar_pull_std"], readings["load"]),
    }
    stray = shares | {"torque": op("Mul", readings["torque_std"], context.rise)}
    reading = {
        "torque": context.torque,
        "sinkage": op("Log", op("Div", sinkage, context.length)),
        "drawbar_pull": op("Div", readings["drawbar_pull"], readings["load"]),
    }
    least = {"torque": context.clear, "sinkage": CLEAR, "drawbar_pull": 1e3}
    weights = []
    for k, name in enumerate(CHANNELS):
        square = op("Mul", stray[name], stray[name])
        total = op("Sqrt", op("Add", square, small(response.error[k] ** 2)))
        counts = op("And", inside, op("Less", shares[name], small(least[name])))
        weights.append(op("Where", counts, op("Div", small(1.0), total), small(0.0)))
    weight = _columns(graph, weights)
    y = op("Mul", _columns(graph, [reading[name] for name in CHANNELS]), weight)
    share = op("Mul", readings["torque_bias"], context.rise)
    nothing = op("Mul", weights[0], small(0.0))
    bias = op("Mul", _columns(graph, [share, nothing, nothing]), weight)
    scaled = op("Mul", response.draw(graph, context.features), weight)
    first = op("Pad", y, _ints(graph, [0, 0, 0, len(response.these) - 1]), small(0.0))
    system = op("Concat", op("Sub", scaled, first), bias, axis=1)
    present = graph.reshaped(op("Greater", weight, small(0.0)), -1)
    system = op("Compress", system, present, axis=0)
    sums = [
        op("ReduceSum", op("Cast", present, to=1), keepdims=0),
        op("Cast", op("Size", inside), to=1),
        op("ReduceSum", op("Cast", inside, to=1), keepdims=0),
    ]
    counted = op("Concat", *[graph.reshaped(s, 1) for s in sums], axis=0)
    return context, Rows(system, inside, counted)


def draw_unbiased(graph: Graph, system: str, count: int) -> str:
    r"""The system (m, terms) with the sensor's bias integrated out.

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \kappa g (g^T A), \qquad
        \kappa = \frac{1 - (1 + g^T g)^{-1/2}}{g^T g}

    for a bias whose prior is normal with standard deviation 1 in units of g. `count` terms.
    """
    op, small = graph.op, graph.small
    a, g = graph.ops("Split", 2, system, _ints(graph, [count, 1]), axis=1)
    size = op("ReduceSumSquare", g, keepdims=1)
    root = op("Sqrt", op("Add", size, small(1.0)))
    kappa = op(
        "Div", op("Sub", small(1.0), op("Div", small(1.0), root)), op("Max", size, small(1e-9))
    )
    along = op("Gemm", g, a, transA=1)
    return op("Gemm", op("Mul", g, kappa), along, a, alpha=-1.0)


def _columns(graph: Graph, values: list[str]) -> str:
    """Values (rows,) of each channel as a column (3 rows, 1), row by row."""
    parts = [graph.reshaped(value, -1, 1) for value in values]
    return graph.reshaped(graph.op("Concat", *parts, axis=1), -1, 1)


def _ints(graph: Graph, values: list[int]) -> str:
    return graph.constant(np.asarray(values, dtype=np.int64))
